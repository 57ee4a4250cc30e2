"""Names of the pictures of a case; who removes or offers them need not load matplotlib."""

PICTURE, CURVE_PICTURE = "picture", "loading"
"""Of the section, and of the stages of loading; the file ends in one of the formats."""

FORMATS = ("png", "svg", "pdf")
"""Of pictures; fields are grids of pixels in all of them, lines and letters can be scaled."""
