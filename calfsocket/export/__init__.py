"""A case as the input of another finite element program, or as a mesh with names."""
