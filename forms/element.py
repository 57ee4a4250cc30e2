"""The mixed element of the section and its quadrature."""

import basix.ufl
from basix.ufl import _ElementBase

# Exact for the pressure equation on straight triangles; 2 is unstable, 3 is good to 5e-7.
QUADRATURE_DEGREE = 4


def section_element(cell: str = "triangle") -> _ElementBase:
    """P2 and cubic bubble for the displacement (sub 0), discontinuous P1 for the pressure (sub 1).

    The conforming Crouzeix-Raviart element: stable at incompressibility, mass balance cell by cell,
    and a pressure that may jump where tissues meet. A continuous pressure (Taylor-Hood) smears
    those jumps, and P2/P0 is too soft where thin stiff layers bend.

    Crouzeix and Raviart, 1973, doi:10.1051/m2an/197307R300331.
    """
    scalar = basix.ufl.enriched_element(
        [basix.ufl.element("Lagrange", cell, 2), basix.ufl.element("Bubble", cell, 3)]
    )
    displacement = basix.ufl.blocked_element(scalar, shape=(2,))
    pressure = basix.ufl.element("Lagrange", cell, 1, discontinuous=True)
    return basix.ufl.mixed_element([displacement, pressure])
