"""What every law has: parameters with units, its energy in UFL, and the same in closed form.

A law is one class. Its fields are its parameters: numbers (MPa, 1/MPa) in Python, texts with a unit
in files. Deformations enter by the principal stretches (l1, l2, l3) with J = l1 l2 l3; the
deviatoric ones are lb_k = J^(-1/3) l_k. Energies are isochoric: the pressure p > 0 in tension and
the bulk modulus K, p = K (J - 1), belong to the weak form (`forms.mixed`).
"""

import json
import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field
from pydantic.fields import FieldInfo
from pydantic.json_schema import SkipJsonSchema
from ufl.core.expr import Expr

from calfsocket.forms.kinematics import Jet
from calfsocket.io.quantity import Written
from calfsocket.io.schema import Strict
from calfsocket.io.units import COMPLIANCE, STRESS

Array = NDArray[Any]

Stress = Annotated[float, Written(STRESS, "12 kPa")]
PositiveStress = Annotated[Stress, Field(gt=0)]
Compliance = Annotated[float, Written(COMPLIANCE, "1.67e-6 1/Pa")]
PoissonRatio = Annotated[float, Field(gt=-1, le=0.5)]

STEP = 1e-200  # of derivatives by a complex step: nothing is subtracted, no digit lost


def as_written(given: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return parameters as files can hold them; a ValueError names what they cannot, a date say."""
    try:
        plain = json.loads(json.dumps(given, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise ValueError(f"it must have texts, numbers and lists of them ({error})") from None
    return None if plain is None else dict(plain)


def in_files(schema: dict[str, Any], law: type) -> None:
    """Describe a law in files to editors: in one line, and with its tag, which Python may omit."""
    schema["description"] = (law.__doc__ or "").partition("\n")[0]
    schema["required"] = ["law", *schema.get("required", [])]


class Law(Strict):
    """An isotropic hyperelastic law; base of `Ogden`, `Yeoh`, `Hencky` and of custom laws.

    A subclass has its parameters as fields and defines `law`, `coefficients`, `energy_form`,
    `energy` and `initial_shear_modulus`; `bulk_modulus` where it is compressible; `kirchhoff` where
    complex stretches are needed. Laws are immutable, hashable, and equal when their class and
    parameters are.

    Attributes
    ----------
    law : str
        Name of the law, which files have as its tag; a subclass gives it a default.
    given : mapping, optional
        The law as it was written, where that was in other parameters (`materials.notations`),
        numbers in MPa and 1/MPa; for people: laws are equal, and have the same hash, without it.

    Examples
    --------
    A neo-Hookean law, psi = mu/2 (I1b - 3), ready for a `MaterialSet`:

    >>> class Custom(Law):
    ...     law: Literal["custom"] = "custom"
    ...     mu: PositiveStress
    ...
    ...     @property
    ...     def initial_shear_modulus(self) -> float:
    ...         return self.mu
    ...
    ...     def coefficients(self) -> tuple[float, ...]:
    ...         return (self.mu,)
    ...
    ...     @staticmethod
    ...     def energy_form(x, J, coefficients):
    ...         (mu,) = coefficients
    ...         strain = first_invariant(x, J)
    ...         return Jet(mu / 2 * strain.value, mu / 2, 0.0).of(strain)
    ...
    ...     def energy(self, stretches):
    ...         return self.mu / 2 * (np.sum(deviatoric(stretches) ** 2, axis=0) - 3)
    >>> Custom(mu="12 kPa").kirchhoff(np.array([2.0, 1.0, 0.5])).round(3)
    array([ 0.027, -0.009, -0.018])
    """

    model_config = ConfigDict(json_schema_extra=in_files)

    law: str
    given: SkipJsonSchema[Annotated[dict[str, Any] | None, AfterValidator(as_written)]] = Field(
        default=None, repr=False
    )

    def __eq__(self, other: object) -> bool:
        """Whether the other is of the same class and has the same parameters."""
        return type(self) is type(other) and self._parameters() == other._parameters()  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        """Return the hash of the class and the parameters."""
        return hash((type(self), self._parameters()))

    def _parameters(self) -> tuple[Any, ...]:
        return tuple(value for name, value in self if name != "given")

    @property
    def name(self) -> str:
        """Name of the law, e.g. "ogden"."""
        return self.law

    @property
    @abstractmethod
    def initial_shear_modulus(self) -> float:
        """mu_0, MPa, > 0."""

    @property
    def bulk_modulus(self) -> float:
        """K, MPa; infinite where incompressible, as laws are unless they say otherwise."""
        return math.inf

    @abstractmethod
    def coefficients(self) -> tuple[float, ...]:
        """Numbers that `energy_form` takes; stresses in MPa."""

    @staticmethod
    @abstractmethod
    def energy_form(x: Expr, J: Expr, coefficients: Sequence[Expr]) -> Jet:
        """Isochoric energy in UFL per reference volume and its derivatives by x, MPa.

        Parameters
        ----------
        x, J : Expr
            Invariants of `forms.kinematics`: (l1 - l2)^2 / (2 J) and det F.
        coefficients : sequence of Expr
            As `coefficients` gives them.
        """

    @abstractmethod
    def energy(self, stretches: Array) -> Any:
        """Isochoric energy per reference volume, MPa; shape (...).

        Independent of `energy_form`, which tests hold against it.

        Parameters
        ----------
        stretches : (3, ...)
            Principal stretches; complex ones are allowed, for derivatives by a complex step.
        """

    def kirchhoff(self, stretches: Array) -> Array:
        """Isochoric Kirchhoff stress, principal: l_k d(energy)/d(l_k), MPa; (3, ...).

        By a complex step unless a law has a closed form of its own, which then takes complex
        stretches, too.

        Parameters
        ----------
        stretches : (3, ...)
            Principal stretches.
        """
        stretches = np.asarray(stretches)
        if np.iscomplexobj(stretches):
            raise TypeError(f"{type(self).__name__}.kirchhoff: define it to use complex stretches")
        tau = np.empty(stretches.shape)
        for k in range(3):
            moved = stretches.astype(complex)
            moved[k] *= 1 + 1j * STEP
            tau[k] = np.imag(self.energy(moved)) / STEP
        return tau

    def cauchy(self, F: Array, p: float) -> Array:
        """Cauchy stress s11, s22, s33, s12 in plane strain, MPa; (4,).

        From the spectral form of b = F F^T: s_k = kirchhoff_k / J + p.

        Parameters
        ----------
        F : (2, 2)
            In-plane deformation gradient.
        p : float
            Pressure, MPa, > 0 in tension.
        """
        squared, n = np.linalg.eigh(F @ F.T)
        stretches = np.sqrt(np.append(squared, 1.0))
        tau, J = self.kirchhoff(stretches), np.prod(stretches)
        sigma = n @ np.diag(tau[:2]) @ n.T / J + p * np.eye(2)
        return np.array([sigma[0, 0], sigma[1, 1], tau[2] / J + p, sigma[0, 1]])

    @classmethod
    def units(cls) -> dict[str, str]:
        """Return the unit of each number among the parameters; "" without dimension."""
        return {
            name: _unit(field)
            for name, field in cls.model_fields.items()
            if name != "given" and not field.exclude and _holds(float, field.annotation)
        }

    def texts(self) -> dict[str, Any]:
        """Parameters as files have them, stresses in kPa where the law is soft; lossless."""
        soft = self.initial_shear_modulus < 1
        units = {STRESS.internal: "kPa"} if soft else {}
        return self.model_dump(mode="json", context={"units": units}, exclude_none=True)


def readable(stress: float) -> str:
    """Write a stress, MPa, in MPa or kPa, to four digits.

    >>> readable(-0.001), readable(2.0)
    ('-1 kPa', '2 MPa')
    """
    return f"{1e3 * stress:.4g} kPa" if 0 < abs(stress) < 1 else f"{stress:.4g} MPa"


def deviatoric(stretches: Array) -> Array:
    """lb_k = J^(-1/3) l_k of principal stretches (3, ...)."""
    return np.asarray(stretches / np.prod(stretches, axis=0) ** (1 / 3))


def _holds(kind: type, annotation: Any) -> bool:
    """Whether a type is another one, or has it among its arguments."""
    return annotation is kind or any(_holds(kind, each) for each in get_args(annotation))


def _unit(field: FieldInfo) -> str:
    """Return the internal unit of a quantity, or of the quantities in a tuple."""
    inner = [mark for each in get_args(field.annotation) for mark in get_args(each)]
    marks = [mark for mark in (*field.metadata, *inner) if isinstance(mark, Written)]
    return marks[0].dimension.internal if marks else ""
