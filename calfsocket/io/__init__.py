"""Errors, configuration, units and files."""
