"""Drawings of a section."""
