"""Numbers of the contact between skin and socket."""

from typing import Annotated

from pydantic import Field

from calfsocket.io.schema import Strict

Number = Annotated[float, Field(strict=True)]


class Contact(Strict):
    """Friction between skin and socket, and the stiffness of Nitsche's method.

    Attributes
    ----------
    friction : float
        Coefficient of friction, >= 0 (paper, section 2.3: 0.4).
    gamma, gamma_t : float
        Normal and tangential Nitsche stiffness in MPa/mm, > 0. The solution does not depend on
        them; the number of Newton iterations does.
    gauss_points : int
        Quadrature points on a skin edge, >= 1. They do not see kinks of the socket's shape
        functions inside the edge: below 1 mm elements that is what is left of the error of contact
        pressure, 2e-7 on the exact ring.

    Raises
    ------
    InputError
        For a number outside its range.
    """

    friction: Annotated[Number, Field(ge=0)] = 0.4
    gamma: Annotated[Number, Field(gt=0, description="MPa/mm")] = 1.0
    gamma_t: Annotated[Number, Field(gt=0, description="MPa/mm")] = 0.5
    gauss_points: Annotated[int, Field(strict=True, ge=1)] = 4
