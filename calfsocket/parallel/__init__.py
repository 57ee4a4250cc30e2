"""MPI: who does what, progress, and a common end."""
