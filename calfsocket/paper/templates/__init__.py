"""Templates of what the paper adds to a page."""
