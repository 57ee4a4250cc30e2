"""How the problems with known answers are made and solved: as the study's are, on one rank or more.

Every one is a `Problem` of the program under its own `LoadStepper`.
"""

from collections.abc import Mapping, Sequence

from calfsocket.contact.parameters import Contact
from calfsocket.materials.laws import Law
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes.distributed import SectionMesh


def solved(problem: Problem, loads: Sequence[float] = (1.0,)) -> Problem:
    """Solve from the present `w`, load by load, to rounding; the residual is that of the end.

    The program's tolerance of 1e-9 N/mm is not yet rounding: one Newton iteration more is.
    """
    stepper = LoadStepper(problem, loads, full_steps_first=False)
    x = stepper.newton.x
    x.array[:] = problem.w.x.array[: len(x.array)]
    stepper.run()
    stepper.newton.iterate()
    problem.residual(x, x.duplicate())
    return problem


def prescribed_supports(
    section: SectionMesh, laws: Mapping[str, Law], contact: Contact
) -> PrescribedMotion:
    """Make bodies to be moved by their supports: the core of the limb and the outer face.

    There is no shrink fit: an overclosure is there at once.
    """
    return PrescribedMotion(limb_problem(section, laws, contact, support="outer-fixed"))
