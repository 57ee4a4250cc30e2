"""Loops over cells in C, generated and compiled."""
