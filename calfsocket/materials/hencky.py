"""Linear elasticity in the logarithmic strain."""

import math
from typing import Any, Literal

import numpy as np

from calfsocket.forms import hencky
from calfsocket.materials.law import Array, Law, PoissonRatio, PositiveStress, deviatoric


class Hencky(Law):
    r"""Linear elasticity in the logarithmic (Hencky) strain, compressible or not.

    .. math:: \psi = \mu \sum_k \ln^2 \bar l_k, \qquad \mu = \frac{E}{2 (1 + \nu)},
              \qquad U = \frac{K}{2} (J - 1)^2, \qquad K = \frac{E}{3 (1 - 2 \nu)}.

    The initial shear modulus is mu. How this differs from Abaqus's "linear elastic" at large strain
    is said in `forms.hencky` and `forms.mixed`.

    Hencky 1928; Anand, On H. Hencky's approximate strain-energy function, 1979,
    doi:10.1115/1.3424532.

    Attributes
    ----------
    e : float
        Young's modulus E, MPa, > 0.
    nu : float
        Poisson's ratio, -1 < nu <= 0.5; 0.5 is incompressible.

    Raises
    ------
    InputError
        Where they are outside this range.

    Examples
    --------
    >>> Hencky(e="11.8 GPa", nu=0.5).bulk_modulus
    inf
    """

    law: Literal["hencky"] = "hencky"
    e: PositiveStress
    nu: PoissonRatio

    energy_form = staticmethod(hencky.energy)

    def coefficients(self) -> tuple[float, ...]:
        """(mu,), MPa."""
        return (self.initial_shear_modulus,)

    @property
    def initial_shear_modulus(self) -> float:
        """E / (2 (1 + nu)), MPa."""
        return self.e / (2 * (1 + self.nu))

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2 nu)), MPa; infinite where incompressible."""
        return self.e / (3 * (1 - 2 * self.nu)) if self.nu < 0.5 else math.inf

    def energy(self, stretches: Array) -> Any:
        """Mu sum_k ln^2 lb_k, MPa."""
        return self.initial_shear_modulus * np.sum(np.log(deviatoric(stretches)) ** 2, axis=0)

    def kirchhoff(self, stretches: Array) -> Array:
        """2 mu ln lb_k, MPa; (3, ...)."""
        return np.asarray(2 * self.initial_shear_modulus * np.log(deviatoric(stretches)))
