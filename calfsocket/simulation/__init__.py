"""One case: simulated, checked and kept."""
