"""Names and quantities as a study file has them; inside, lengths are mm, angles degrees."""

from typing import Annotated

from pydantic import Field, StringConstraints

from calfsocket.io.quantity import Written
from calfsocket.io.units import ANGLE, LENGTH, SHARE

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._+-]{0,39}$")]
"""A word of a folder's name and of a cell in a table: no path, no formula, no markup."""

Length = Annotated[float, Written(LENGTH, "4.5 mm")]
PositiveLength = Annotated[Length, Field(gt=0)]
Angle = Annotated[float, Written(ANGLE, "90 deg")]
PositiveAngle = Annotated[Angle, Field(gt=0)]
Share = Annotated[float, Written(SHARE, "5 %")]
File = Annotated[str, StringConstraints(min_length=1, max_length=500)]
"""Path of a file to read, from the folder of the study file."""
