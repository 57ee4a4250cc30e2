"""Names and files as a study file gives them."""

from typing import Annotated

from pydantic import StringConstraints

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._+-]{0,39}$")]
"""Part of a folder's name and of a cell in a table: no path, no formula, no markup."""

File = Annotated[str, StringConstraints(min_length=1, max_length=500)]
"""Path of a file to read, from the folder of the study file."""
