"""Studies: files, cases, sweeps, and their run."""
