"""Laws fitted to stress-stretch data (the paper's section 2.2): ``python3 -m calfsocket fit``."""
