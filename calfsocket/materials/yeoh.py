"""Yeoh's law."""

from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from calfsocket.forms import yeoh
from calfsocket.materials.law import Array, Law, PositiveStress, Stress, deviatoric


class Yeoh(Law):
    r"""Yeoh's law, incompressible.

    .. math:: \psi = \sum_{n=1}^3 C_{n0} (\bar I_1 - 3)^n,
              \qquad \bar I_1 = \bar l_1^2 + \bar l_2^2 + \bar l_3^2.

    The initial shear modulus is mu_0 = 2 C10. C10 + 2 C20 i + 3 C30 i^2 must stay positive for
    every i = I1b - 3 >= 0.

    Yeoh, Some forms of the strain energy function for rubber, 1993, doi:10.5254/1.3538343.

    Attributes
    ----------
    c10, c20, c30 : float
        Coefficients, MPa; C10 > 0, C30 >= 0, C20 > -sqrt(3 C10 C30).

    Raises
    ------
    InputError
        Where they are outside this range.

    Examples
    --------
    >>> Yeoh(c10="4.91 MPa", c20=13.59, c30=18.97).initial_shear_modulus
    9.82
    """

    law: Literal["yeoh"] = "yeoh"
    c10: PositiveStress
    c20: Stress = 0.0
    c30: Stress = 0.0

    energy_form = staticmethod(yeoh.energy)

    @model_validator(mode="before")
    @classmethod
    def _incompressible(cls, data: Any) -> Any:
        if isinstance(data, dict) and (bulk := data.keys() & {"d1", "k", "kappa", "nu"}):
            raise ValueError(
                f"Yeoh's law is taken as incompressible; remove {', '.join(sorted(bulk))}"
            )
        return data

    @model_validator(mode="after")
    def _stiff(self) -> "Yeoh":
        softens = self.c20 < 0 and self.c20**2 >= 3 * self.c10 * self.c30
        if self.c30 < 0 or softens:
            raise ValueError(
                f"with C10, C20, C30 = {self.c10:g}, {self.c20:g}, {self.c30:g} MPa the stiffness "
                "falls to 0 at large strain; give C30 >= 0, and C20 > -sqrt(3 C10 C30)"
            )
        return self

    def coefficients(self) -> tuple[float, ...]:
        """(C10, C20, C30), MPa."""
        return self.c10, self.c20, self.c30

    @property
    def initial_shear_modulus(self) -> float:
        """2 C10, MPa."""
        return 2 * self.c10

    def energy(self, stretches: Array) -> Any:
        """sum_n Cn0 (sum_k lb_k^2 - 3)^n, MPa."""
        i = np.sum(deviatoric(stretches) ** 2, axis=0) - 3
        return self.c10 * i + self.c20 * i**2 + self.c30 * i**3

    def kirchhoff(self, stretches: Array) -> Array:
        """2 psi' (lb_k^2 - mean_k lb_k^2) with psi' the derivative by I1b, MPa; (3, ...)."""
        squared = deviatoric(stretches) ** 2
        i = np.sum(squared, axis=0) - 3
        slope = self.c10 + 2 * self.c20 * i + 3 * self.c30 * i**2
        return np.asarray(2 * slope * (squared - np.mean(squared, axis=0)))
