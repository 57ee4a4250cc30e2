"""How fast calfsocket is: `python3 -m benchmarks` measures it and compares it with a baseline."""
