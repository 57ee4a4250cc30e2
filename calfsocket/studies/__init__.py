"""Studies of the package as files: the paper's, an example, and their JSON schema."""
