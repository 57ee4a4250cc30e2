"""Laws as objects: ranges, ways of writing, values; and a custom law from a script, solved."""

import math
import pickle
import textwrap
from typing import Literal

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.forms.kinematics import Jet, first_invariant
from calfsocket.io.errors import InputError
from calfsocket.materials.law import Law, PositiveStress, deviatoric
from calfsocket.materials.laws import LAWS, Hencky, Ogden, Yeoh, material_law
from calfsocket.materials.tissues import BONE, SKIN, SOCKET
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes.rings import ring_mesh
from calfsocket.verification.material_point import (
    LOAD_CASES,
    TAYLOR_POINTS,
    moduli_error,
    taylor_orders,
    worst_error,
)
from calfsocket.verification.tangent import difference, random_direction


def ogden(mu=(1.0,), alpha=(2.0,), **others):
    return Ogden(mu=mu, alpha=alpha, **(others or {"d1": 0.1}))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ogden((0.0,)), "Ogden: initial shear modulus is 0 MPa; it must be greater than 0"),
        (lambda: ogden((1.0, -2.0), (2.0, 3.0)), "initial shear modulus is -1 MPa"),
        (lambda: ogden((math.nan,)), "Ogden: mu: is nan; it must be a finite number"),
        (lambda: ogden(alpha=(-2.0,), d1=0.1, form="as-printed"), "shear modulus is -1 MPa"),
        (lambda: ogden(alpha=(0.0,)), "alpha is 0"),
        (lambda: ogden(alpha=(math.inf,)), "alpha: is inf"),
        (lambda: ogden((1.0, 2.0)), "mu has length 2, alpha 1"),
        (lambda: ogden((), ()), "mu has length 0, alpha 0"),
        (lambda: ogden(d1=-0.1), "d1: is -0.1; it must be greater than or equal to 0"),
        (lambda: ogden(nu=0.51), "nu: is 0.51; it must be less than or equal to 0.5"),
        (lambda: ogden(nu=0.4, d1=0.1), "give one of d1, k and nu"),
        (lambda: Ogden(mu=(1.0,), alpha=(2.0,)), "give one of d1, k and nu"),
        (
            lambda: ogden(d1=0.1, form="printed"),
            "it must be 'abaqus', 'textbook', 'febio' or 'as-printed'",
        ),
        (lambda: ogden(d1=0.1, fomr="abaqus"), "unknown key 'fomr'; did you mean 'form'?"),
        (lambda: material_law("neo-hookean", mu=-1.0, nu=0.4), "mu: is -1.0; it must be greater"),
        (lambda: material_law("neo-hookean", mu=1.0), "neo-hookean: give one of d1, k and nu"),
        (lambda: Yeoh(c10=0.0, c20=1.0, c30=1.0), "Yeoh: c10: is 0.0; it must be greater than 0"),
        (lambda: Yeoh(c10=1.0, c20=math.nan), "c20: is nan"),
        (lambda: Yeoh(c10=1.0, c20=1.0, c30=-1.0), "C30 >= 0"),
        (lambda: Yeoh(c10=1.0, c20=-1.8, c30=1.0), "C20 > -sqrt"),
        (lambda: Yeoh(c10=1.0, c20=-0.1), "C20 > -sqrt"),
        (lambda: Hencky(e=-1.0, nu=0.3), "Hencky: e: is -1.0; it must be greater than 0"),
        (lambda: Hencky(e="1", nu=0.3), "e: unit '' is unknown; use Pa, kPa, MPa"),
        (lambda: Hencky(e=1.0, nu=0.51), "nu: is 0.51"),
        (lambda: Hencky(e=1.0, nu=-1.0), "nu: is -1.0"),
        (lambda: Hencky(e=1.0, nu=math.nan), "nu: is nan"),
    ],
)
def test_bad_parameters_are_refused(make, message: str) -> None:
    with pytest.raises(InputError) as raised:
        make()
    assert message in str(raised.value)


def test_allowed_limits() -> None:
    assert Hencky(e=1.0, nu=0.5).bulk_modulus == math.inf
    assert ogden(d1=0.0).bulk_modulus == ogden(nu=0.5).bulk_modulus == math.inf
    assert Yeoh(c10=1.0, c20=-1.7, c30=1.0).c20 == -1.7  # above -sqrt(3)


def test_ways_of_writing_a_law() -> None:
    # nu = 0.495, by hand: D1 = 3 0.01/(1.495 mu).
    by_nu = Ogden(mu=(1e-3,), alpha=(26,), nu=0.495)
    assert by_nu.d1 == pytest.approx(0.03 / 1.495e-3, rel=1e-12)
    assert by_nu == Ogden(mu=("1 kPa",), alpha=(26.0,), d1=by_nu.d1)
    assert material_law("neo-hookean", mu=2.0, d1=0.1) == ogden((2.0,))


@pytest.mark.parametrize("law", [SKIN, Yeoh(c10=1.0), BONE, ogden(nu=0.45)])
def test_laws_are_values(law: Law) -> None:
    for same in (
        type(law)(**law.model_dump()),
        type(law)(**law.texts()),
        type(law).model_validate_json(law.model_dump_json()),
        pickle.loads(pickle.dumps(law)),
    ):
        assert same == law and hash(same) == hash(law)
    assert LAWS[law.name] is type(law)
    assert set(law.units()) < set(law.model_dump())
    with pytest.raises(ValueError, match="frozen"):
        law.law = "other"


class Gent(Law):
    """Gent's law, psi = -mu Jm/2 ln(1 - (I1b - 3)/Jm); doi:10.5254/1.3538357."""

    law: Literal["gent"] = "gent"
    mu: PositiveStress
    jm: float

    @property
    def initial_shear_modulus(self) -> float:
        return self.mu

    def coefficients(self) -> tuple[float, ...]:
        return self.mu, self.jm

    @staticmethod
    def energy_form(x, J, coefficients):
        import ufl

        mu, jm = coefficients
        strain = first_invariant(x, J)
        left = 1.0 - strain.value / jm
        psi = Jet(-0.5 * mu * jm * ufl.ln(left), 0.5 * mu / left, 0.5 * mu / (jm * left**2))
        return psi.of(strain)

    def energy(self, stretches):
        left = 1 - (np.sum(deviatoric(stretches) ** 2, axis=0) - 3) / self.jm
        return -0.5 * self.mu * self.jm * np.log(left)


GENT = Gent(mu=0.3, jm=20.0)


@pytest.mark.parametrize("case", LOAD_CASES)
def test_a_custom_law_has_the_stress_of_its_closed_form(case: str) -> None:
    assert worst_error(GENT, case, 2.0) < 1e-12


@pytest.mark.parametrize("where", TAYLOR_POINTS)
def test_a_custom_law_has_the_tangent_of_its_stress(where: str) -> None:
    assert min(taylor_orders(GENT, where)) > 1.9
    assert moduli_error(GENT) < 1e-14


def test_stress_by_a_complex_step() -> None:
    """Gent's, by hand: 2 psi' (lb_k^2 - mean)."""
    stretches = np.array([1.3, 0.9, 1.1])
    squared = deviatoric(stretches) ** 2
    slope = 0.15 / (1 - (np.sum(squared) - 3) / 20)
    expected = 2 * slope * (squared - np.mean(squared))
    assert GENT.kirchhoff(stretches) == pytest.approx(expected, rel=1e-14)
    with pytest.raises(TypeError, match=r"Gent\.kirchhoff"):
        GENT.kirchhoff(stretches + 0j)


LAYERS = [("bone", 10.0, 14.0), ("muscle", 14.0, 30.0), ("skin", 30.0, 32.0)]


def test_a_custom_law_in_contact() -> None:
    """In a tissue and in the skin: equilibrium, and a tangent that is the residual's."""
    section = ring_mesh(MPI.COMM_SELF, LAYERS, (31.8, 36.0), h=4.0)
    laws = {"bone": BONE, "muscle": SKIN, "skin": GENT, "socket": SOCKET}
    problem = limb_problem(section, laws)
    stepper = LoadStepper(problem, (0.5, 1.0))
    stepper.run()
    x = stepper.newton.x
    found = difference(problem, x, random_direction(problem, x))
    assert found.error < 1e-6


def test_a_law_defined_in_a_script_is_compiled(mpirun, tmp_path) -> None:
    """No source that the interpreter could find: the law is known by its expressions."""
    script = tmp_path / "own.py"
    script.write_text(
        textwrap.dedent(
            """
            SOURCE = '''
            from typing import Literal
            import numpy as np
            from calfsocket.forms.kinematics import Jet, first_invariant
            from calfsocket.materials.law import Law, PositiveStress, deviatoric

            class Custom(Law):
                law: Literal["custom"] = "custom"
                mu: PositiveStress
                initial_shear_modulus = property(lambda self: self.mu)
                def coefficients(self): return (self.mu,)
                @staticmethod
                def energy_form(x, J, coefficients):
                    strain, factor = first_invariant(x, J), FACTOR * coefficients[0]
                    return Jet(factor * strain.value, factor, 0.0).of(strain)
                def energy(self, stretches):
                    return FACTOR * self.mu * (np.sum(deviatoric(stretches) ** 2, axis=0) - 3)
            '''
            from mpi4py import MPI
            from calfsocket.materials.fields import kind
            from calfsocket.mechanics.kernels import library
            from calfsocket.mechanics.kernels.laws import signature
            names = set()
            for factor in (0.5, 1.0, 0.5):
                scope = {"FACTOR": factor, "__name__": "own"}
                exec(SOURCE, scope)
                law = scope["Custom"](mu=1.0)
                names.add(signature(kind(law)))
                library.library(MPI.COMM_WORLD, kind(law))
            line = " ".join([str(len(names)), *sorted(names)])
            print(line + "\\n", end="")  # at once: the other rank writes, too
            """
        )
    )
    first, second = (mpirun(n, [script]).splitlines() for n in (1, 2))
    assert first[0].startswith("2 ") and set(second) == set(first)
