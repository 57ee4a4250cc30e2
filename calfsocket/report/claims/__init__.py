"""The paper's claims, each with a function that checks it against the model and the runs.

Importing this package registers them all.
"""

from calfsocket.report.claims import (  # noqa: F401
    calibration,
    changes,
    contact,
    geometry,
    materials,
    maxima,
    method,
    risk,
)
