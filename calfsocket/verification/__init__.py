"""Proof of the mechanics: problems with exact solutions, solved by the program's own parts."""
