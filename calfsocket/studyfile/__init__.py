"""Study files: cases of one's own as TOML, checked before anything is solved."""
