"""Other ways of writing a law, each converted once into one of the package's laws.

The law that comes of it has what was written in its `given`. All have the volumetric energy
K/2 (J - 1)^2 of the package's laws, which is Abaqus's; isochoric stretches are lb_k = J^(-1/3) l_k.
"""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, ValidatorFunctionWrapHandler, WrapValidator, model_validator

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict
from calfsocket.materials.hencky import Hencky
from calfsocket.materials.law import (
    Compliance,
    Law,
    PoissonRatio,
    PositiveStress,
    Stress,
    as_written,
    in_files,
)
from calfsocket.materials.ogden import Ogden, one_of


class _WithBulk(Strict):
    """A notation with one of the parameters that give the bulk modulus."""

    model_config = ConfigDict(json_schema_extra=in_files)

    d1: Annotated[Compliance, Field(ge=0)] | None = None
    k: PositiveStress | None = None
    nu: PoissonRatio | None = None

    @model_validator(mode="before")
    @classmethod
    def _kappa(cls, data: Any) -> Any:
        """Take the bulk modulus by its other name, too."""
        if isinstance(data, dict) and "kappa" in data and "k" not in data:
            return {"k" if key == "kappa" else key: value for key, value in data.items()}
        return data

    @property
    def bulk(self) -> dict[str, Any]:
        """The parameter that is given."""
        values = {"d1": self.d1, "k": self.k, "nu": self.nu}
        one_of(values)
        return {key: value for key, value in values.items() if value is not None}


class MooneyRivlin(_WithBulk):
    r"""Mooney and Rivlin's law; becomes Ogden's with two terms.

    .. math:: \psi = C_{10} (\bar I_1 - 3) + C_{01} (\bar I_2 - 3)

    With l1b l2b l3b = 1, I2b is the sum of lb_k^-2: Ogden's law in Abaqus's form with mu = (2 C10,
    2 C01) and alpha = (2, -2), exactly. The initial shear modulus is 2 (C10 + C01).

    Rivlin 1948, doi:10.1098/rsta.1948.0024.

    Attributes
    ----------
    c10, c01 : float
        Coefficients, MPa; their sum is positive.
    d1, k, nu : float
        One of them, as of `Ogden`.
    """

    law: Literal["mooney-rivlin"] = "mooney-rivlin"
    c10: Stress
    c01: Stress

    def used(self) -> Law:
        """Return the law."""
        mu = (2 * self.c10, 2 * self.c01)
        return Ogden(mu=mu, alpha=(2.0, -2.0), form="abaqus", **self.bulk)


class NeoHookean(_WithBulk):
    r"""Neo-Hookean law; becomes Ogden's with one term and alpha = 2.

    .. math:: \psi = \frac{\mu}{2} (\bar I_1 - 3) = C_{10} (\bar I_1 - 3),
              \qquad \mu = \frac{E}{2 (1 + \nu)}

    Programs whose neo-Hookean law is not split into isochoric and volumetric parts differ where the
    volume changes; at small strain all are the same.

    Treloar, The elasticity of a network of long-chain molecules II, 1943, doi:10.1039/TF9433900241.

    Attributes
    ----------
    mu : float
        Initial shear modulus, MPa, > 0.
    c10 : float
        A way to give `mu`: half of it, MPa.
    e : float
        A way to give `mu`, with `nu`: Young's modulus at small strain, MPa.
    d1, k, nu : float
        One of them, as of `Ogden`.
    """

    law: Literal["neo-hookean"] = "neo-hookean"
    mu: PositiveStress | None = None
    c10: PositiveStress | None = None
    e: PositiveStress | None = None

    def used(self) -> Law:
        """Return the law."""
        given = [key for key in ("mu", "c10", "e") if getattr(self, key) is not None]
        if len(given) != 1:
            what = f"; {' and '.join(given)} are given" if given else ""
            raise ValueError(f"give one of mu, c10, and e with nu{what}")
        if self.e is not None and self.nu is None:
            raise ValueError("e needs Poisson's ratio; give nu, and neither d1 nor k")
        factor = {"mu": 1.0, "c10": 2.0, "e": 1 / (2 * (1 + (self.nu or 0.0)))}[given[0]]
        mu = factor * getattr(self, given[0])
        return Ogden(mu=(mu,), alpha=(2.0,), form="abaqus", **self.bulk)


class LinearElastic(Strict):
    """Linear elasticity; becomes Hencky's, linear in the logarithmic strain.

    At small strain nothing else is meant by it. At large strain there are several laws of this
    name: this one has an energy, stresses of the same size in tension and compression by the same
    factor, and does not soften to nothing in compression, as Saint-Venant and Kirchhoff's does.

    Attributes
    ----------
    e : float
        Young's modulus, MPa, > 0.
    nu : float
        Poisson's ratio, -1 < nu <= 0.5; 0.5 is incompressible.
    """

    model_config = ConfigDict(json_schema_extra=in_files)

    law: Literal["linear-elastic"] = "linear-elastic"
    e: PositiveStress
    nu: PoissonRatio

    def used(self) -> Law:
        """Return the law."""
        return Hencky(e=self.e, nu=self.nu)


def _converted(data: Any, handler: ValidatorFunctionWrapHandler) -> Law:
    """Return the law that a notation becomes, with what was written."""
    try:
        law: Law = handler(data).used()
    except InputError as error:  # of the law: what was written is another one
        raise ValueError(str(error).partition(": ")[2]) from None
    return law.model_copy(update={"given": as_written(data)})


_Converted = WrapValidator(_converted)

Notation = (
    Annotated[MooneyRivlin, _Converted]
    | Annotated[NeoHookean, _Converted]
    | Annotated[LinearElastic, _Converted]
)
"""A law in a file that becomes another one."""
