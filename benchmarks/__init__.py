"""How fast calfsocket is: `python3 -m benchmarks` measures, prints tables and writes JSON."""
