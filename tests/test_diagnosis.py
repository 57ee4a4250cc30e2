"""Why a load step failed: every cause made to happen, named with its place, and in order."""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import ConvergenceError
from calfsocket.materials import material_set
from calfsocket.materials.laws import Hencky, Ogden
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics import diagnosis
from calfsocket.mechanics.diagnosis import Grip, Iterate, Motion, State, explain, findings
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.newton import Newton, NewtonResult
from calfsocket.mechanics.problem import Site
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes.placement import check_placement
from calfsocket.meshes.rings import ring_mesh
from calfsocket.meshes.socket import NormalOffset, Outline, Socket
from calfsocket.simulation.simulation import Simulation
from tiny_study import OVALS, tiny_limb, tiny_socket

BUCKLED = "take smaller load steps (steps.largest = 0.05)"
SOFT_SKIN = {"muscle": Hencky(e=5e-4, nu=0.45), "skin": Hencky(e=20.0, nu=0.45)}


def bulging(base: float, amplitude: float) -> Socket:
    """Return a socket that presses the tiny limb at 40 deg."""
    bump = {"center": 40, "width": 25, "amplitude": amplitude}
    return NormalOffset(name="S", wall_thickness=2.0, base=base, bumps=[bump])


def beside() -> Socket:
    """Return a socket with the tiny limb's own outline, 1 mm beside it."""
    angle = np.linspace(0.0, 2 * np.pi, 240, endpoint=False)
    x, y = OVALS["outside"]
    points = tuple(zip(x * np.cos(angle), y * np.sin(angle), strict=True))
    return Outline(name="O", wall_thickness=2.0, points=points, shift=(1.0, 0.0))


def fails(socket: Socket, laws: dict, support: str = "floating") -> str:
    """Return what a simulation of the tiny limb says when it fails."""
    simulation = Simulation(
        tiny_limb(),
        socket,
        MaterialSet.paper("separate").replace(**laws),
        "coarse",
        support=support,
        steps=LoadSteps(smallest=0.05, extrapolate=False),
        comm=MPI.COMM_SELF,
        # Also of a socket that would be refused, for it only moves away.
        placement=check_placement(socket, tiny_limb(), floating=False),
    )
    with pytest.raises(ConvergenceError) as caught:
        simulation.solve()
    return str(caught.value)


def ring_that_buckles(comm: MPI.Intracomm = MPI.COMM_SELF) -> str:
    """Return what a thin, stiff fascia in a soft muscle says when it is squeezed by a tenth."""
    layers = [("bone", 10, 14), ("muscle", 14, 29), ("fascia", 29, 29.3), ("skin", 29.3, 32)]
    laws = MaterialSet.paper("separate").tissue_laws()
    laws |= dict.fromkeys(("muscle", "skin"), Hencky(e=2e-4, nu=0.49))
    laws["fascia"] = Hencky(e=20.0, nu=0.4)
    section = ring_mesh(comm, layers, (28.0, 36.0), 2.0)
    problem = limb_problem(
        section, {name: laws[name] for name in section.regions}, Contact(friction=0.0)
    )
    stepper = LoadStepper(problem, LoadSteps(first=0.05, smallest=0.05))
    with pytest.raises(ConvergenceError) as caught:
        stepper.run()
    return str(caught.value)


SOFTENING = {"muscle": Ogden(mu=(-0.0157, 0.017), alpha=(-3.3, 5.1), nu=0.495)}
WEAK_IN_VOLUME = {"muscle": Ogden(mu=(0.002,), alpha=(2.0,), nu=0.2)}

FAILURES = {
    "a law softens": (
        partial(fails, tiny_socket("C"), SOFTENING),
        r"the law of muscle at \(.*\) mm has softened to \d\d % of its initial stiffness at load "
        r"0\.\d+, stretched to 0\.98\d and 0\.97\d",
        "use a law that is stable at these stretches",
    ),
    "a ring buckles": (
        ring_that_buckles,
        r"tissue buckles: the equilibrium at load 0\.\d+ has \d\d negative modes, with most "
        r"motion in (muscle|fascia|skin) at \(.*\) mm",
        BUCKLED,
    ),
    "a tissue is crushed": (
        partial(fails, bulging(3.5, 2.0), WEAK_IN_VOLUME),
        r"muscle at \(.*\) mm is compressed to \d+ % of itself at load 0\.\d+",
        "use a socket that presses less there, or a law that resists compression more",
    ),
    "a socket slips off": (
        partial(fails, beside(), {}),
        r"nothing holds the socket: it touches \d\d % of the skin, from \d+ to \d+ deg and moves "
        r"by .* mm and .* deg in this step",
        "a floating socket must press on the limb from all sides",
    ),
    "a socket turns": (
        partial(fails, bulging(1.0, 0.6), SOFT_SKIN),
        r"the socket moves as a rigid body, by .* mm and -\d\.\d deg in this step, with \d+ % of "
        "its contact slipping",
        "take smaller load steps",
    ),
    "contact does not settle": (
        partial(fails, bulging(0.5, 4.0), SOFT_SKIN, "outer-fixed"),
        r"contact does not settle: \d+ of the skin's 176 points open, close, stick, slip",
        "take smaller load steps",
    ),
}


@pytest.fixture(scope="module", autouse=True)
def unstable_laws() -> Iterator[None]:
    """Let laws be used that lose stability at small strain: with them, a solution surely fails."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(material_set, "refusal", lambda law: "")
        yield


@pytest.mark.parametrize("cause", FAILURES)
def test_a_failure_that_happens_is_named_with_its_place_before_any_advice(cause):
    fail, says, advice = FAILURES[cause]
    text = fail()
    assert "\n" not in text
    first = r"no equilibrium between load 0\.\d{4} and 0\.\d{4}: "
    found = re.match(first + says, text)
    assert found, text
    assert text.index(advice) > found.end()
    history = r"\(Newton's method: diverged_\w+ after \d+ iterations, residual .* \.\.\. .* N/mm, "
    assert re.search(history, text)


def test_every_rank_says_the_same(mpirun):
    program = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); "
        "from mpi4py import MPI; from test_diagnosis import ring_that_buckles; "
        "said = MPI.COMM_WORLD.gather(ring_that_buckles(MPI.COMM_WORLD)); "
        "MPI.COMM_WORLD.rank or print(len(set(said)), said[0])"
    )
    said = mpirun(2, ["-c", program])
    assert said.startswith("1 no equilibrium") and "tissue buckles: the equilibrium at load" in said


def test_the_last_equilibrium_is_left_as_it_was():
    """The diagnosis iterates once more, and evaluates the state that is kept."""
    with pytest.raises(ConvergenceError) as caught:
        Simulation(
            tiny_limb(), tiny_socket("C"), MaterialSet.paper("separate").replace(**SOFTENING),
            "coarse", steps=LoadSteps(first=0.5, largest=0.5, smallest=0.3), comm=MPI.COMM_SELF,
        ).solve()  # fmt: skip
    checks = caught.value.result.checks
    assert checks.load == 0.5 and checks.relative_force_imbalance < 1e-6
    assert checks.negative_modes == 0


def test_an_iterate_without_finite_forces_is_not_looked_at_any_further():
    """Its displacements are finite, but cells are inside out: laws and tangent have no values."""
    section = ring_mesh(MPI.COMM_SELF, [("bone", 10, 14), ("muscle", 14, 32)], (30.0, 36.0), 6.0)
    laws = MaterialSet.paper("separate").tissue_laws()
    problem = limb_problem(section, {name: laws[name] for name in section.regions})
    newton = Newton(problem)
    equilibrium = newton.x.copy()
    for scale, finite in ((1.0, True), (np.nan, False)):
        newton.x.array = scale * 50.0 * np.random.default_rng(3).standard_normal(newton.x.size)
        assert np.isfinite(newton.x.norm()) == finite
        iterate = diagnosis.last_iterate(newton, problem, equilibrium)
        assert iterate.state is None and iterate.unbalanced in section.regions
        text = explain(WELL, 0.5, 0.6, RESULT, iterate)
        assert "0.6000: Newton's method runs away to displacements or forces that are not" in text
        assert f"most of it in {iterate.unbalanced})" in text


# -- from numbers ---------------------------------------------------------------------------------

MUSCLE = Site("muscle", 1.0, -2.0)
WELL = State(0.5, 0.9, MUSCLE, 1.0, MUSCLE, (1.1, 0.9), 0, None, None)
HELD = Grip(share=1.0, slipping=0.1, opening=10.0, between=(0.0, 360.0))
RESULT = NewtonResult(False, 3, 1e-3, "diverged_max_it", (1.0, 0.1, 1e-3))


def said(equilibrium: State = WELL, **iterate: object) -> list[str]:
    iterate = {"unbalanced": "fat", "state": WELL} | iterate
    return [finding.text for finding in findings(equilibrium, Iterate(**iterate))]


def test_without_a_finding_it_says_what_was_looked_at():
    text = explain(WELL, 0.5, 0.6, RESULT, Iterate("fat", WELL))
    assert text.startswith("no equilibrium between load 0.5000 and 0.6000: no tissue is crushed")
    assert text.endswith("residual 1.0e+00 1.0e-01 1.0e-03 N/mm, most of it in fat)")


def test_an_iteration_that_ran_away_leaves_the_equilibrium_to_look_at():
    (text,) = said(state=None)
    assert "runs away" in text
    assert "softened to 10 %" in said(replace(WELL, stiffness=0.1), state=None)[0]


def test_the_order_is_that_of_causes():
    """What loses its grip also slips; what has softened also buckles and is crushed."""
    bad = replace(
        WELL, stiffness=0.1, negative_modes=2, waving=MUSCLE, volume_ratio=-0.1,
        grip=replace(HELD, share=0.2, opening=200.0, between=(10.0, 80.0)),
    )  # fmt: skip
    words = [text.split(" ")[0:2] for text in said(bad, state=bad, unsettled=3, points=9)]
    assert words == [
        ["nothing", "holds"],
        ["the", "law"],
        ["tissue", "buckles:"],
        ["muscle", "at"],
        ["contact", "does"],
    ]
    assert "turned inside out" in said(bad)[2]
    text = explain(bad, 0.5, 0.6, RESULT, Iterate("fat", bad))
    assert "from all sides" in text and BUCKLED not in text


def test_modes_whose_place_is_not_found_are_named_all_the_same():
    (text,) = said(replace(WELL, negative_modes=1))
    assert text.endswith("the equilibrium at load 0.5000 has 1 negative mode")


def test_a_mode_of_the_socket_is_not_buckling():
    moved = replace(WELL, negative_modes=1, waving=Site("socket", 0.0, 0.0))
    assert said(moved) == []


def test_a_socket_that_is_held_slides_only_where_most_of_the_step_is_its_motion():
    held = replace(WELL, grip=HELD)
    assert said(state=held, motion=Motion(0.1, 1.0, 0.2)) == []
    (text,) = said(state=held, motion=Motion(0.1, 1.0, 0.8))
    assert text.endswith("by 0.1 mm and 1 deg in this step, with 10 % of its contact slipping")


def test_the_stiffness_of_a_law_is_that_of_its_closed_form():
    """Of Ogden's law with alpha = 2, t1 - t2 = mu J^(-2/3) (l1^2 - l2^2): mu (l1^2 + l2^2) / 2."""
    l1, l2 = np.array([[1.0, 1.2, 0.9], [1.0, 0.8, 0.7]])
    found = diagnosis.stiffness_share(Ogden(mu=(3.0,), alpha=(2.0,), nu=0.4), np.array([l1, l2]))
    expected = 0.5 * (l1**2 + l2**2) * (l1 * l2) ** (-2 / 3)
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    hencky = diagnosis.stiffness_share(Hencky(e=1.0, nu=0.3), np.array([l1, l2]))
    np.testing.assert_allclose(hencky, 1.0, rtol=1e-8)


def test_the_opening_between_directions():
    assert diagnosis._largest_opening(np.array([])) == (0.0, 360.0)
    assert diagnosis._largest_opening(np.array([90.0])) == (90.0, 360.0)
    assert diagnosis._largest_opening(np.array([-10.0, 30.0, 200.0])) == (200.0, 170.0)
    assert diagnosis._largest_opening(np.array([350.0, 100.0, 20.0])) == (350.0, 250.0)
