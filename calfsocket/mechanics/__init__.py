"""Equilibrium of bodies in contact: problem, solver, load steps."""
