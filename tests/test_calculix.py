"""What CalculiX finds from exported decks: contact along the skin of TSB Combined, changes of size.

The curves in data/ are CalculiX 2.20's, run once with the decks of `export --format calculix`, and
means over 3 mm along the skin: traction for each mm of undeformed length, from the nodal forces
that its stresses in the skin give.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calfsocket import (
    Contact,
    Limb,
    Liner,
    Loading,
    MaterialSet,
    Ogden,
    Simulation,
    Socket,
    Stage,
)
from calfsocket.postprocess.contact_line import running_mean
from tiny_study import OVALS, tiny_limb, tiny_socket

DATA = Path(__file__).parent / "data"


@pytest.mark.parametrize("support", ["outer-fixed", "floating"])
def test_contact_agrees_with_calculix(support):
    limb, socket = Limb.reference(), Socket.reference("TSB")
    simulation = Simulation(limb, socket, MaterialSet.paper("combined"), "coarse", support=support)
    line = simulation.solve().line
    theirs = pd.read_csv(DATA / f"calculix_tsb_combined_{support}.csv")
    middle, length = np.cumsum(line.weight_mm) - 0.5 * line.weight_mm, line.weight_mm.sum()
    pressure, shear = (
        np.interp(theirs.arc_mm, middle, running_mean(line, values=values), period=length)
        for values in (line.pressure_kPa, line.shear_kPa)
    )
    mean = theirs.pressure_kPa.mean()
    assert pressure.mean() == pytest.approx(mean, rel=0.005)
    rms = np.sqrt(np.mean((pressure - theirs.pressure_kPa) ** 2))
    assert rms < 0.01 * mean
    ratio = np.abs(theirs.shear_kPa).mean() / mean
    assert np.abs(shear).mean() / pressure.mean() == pytest.approx(ratio, rel=0.02)
    assert np.corrcoef(shear, theirs.shear_kPa)[0, 1] > 0.99


SOFT = Ogden(mu=(0.02,), alpha=(2.0,), nu=0.4)
UNDERSIZED = {"thickness": 2.0, "law": SOFT, "undersize": 0.05}
SMALL = {
    "liner_on_limb": {"liner": Liner(bonded="limb", **UNDERSIZED)},
    "liner_in_socket": {"liner": Liner(bonded="socket", **UNDERSIZED)},
    "shrunk_muscle": {"loading": Loading(stages=(Stage(name="shrink", volume={"muscle": -0.03}),))},
}


@pytest.mark.parametrize(("name", "most"), [
    ("liner_on_limb", 0.03), ("liner_in_socket", 0.04), ("shrunk_muscle", 0.1),
])  # fmt: skip
def test_tissue_is_where_calculix_has_it_after_a_change_of_size(name, most):
    """A liner with an undersize, or a muscle that has shrunk, in a small limb without friction.

    The displacements in data/ are those of the skin's nodes, or of the muscle's outer ones in the
    stage alone.
    They differ by 2 to 8 %, for CalculiX 2.20 refers stresses to the expanded material
    (docs/formats/export.md); those of a liner without undersize by 30 %.
    """
    stiff = Ogden(mu=(0.06,), alpha=(2.0,), nu=0.4)
    materials = MaterialSet.paper("separate").replace(skin=stiff, muscle=SOFT)
    arguments = {"support": "outer-fixed", "contact": Contact(friction=0.0), **SMALL[name]}
    simulation = Simulation(tiny_limb(), tiny_socket("C"), materials, "coarse", **arguments)
    result = simulation.solve()
    fields = result.fields
    moved = fields.displacement
    for state in result.states.values():  # that of the stage alone
        moved = state.fields.displacement - moved
    theirs = pd.read_csv(DATA / f"calculix_{name}.csv")
    oval = OVALS["inside" if simulation.loading else "outside"]
    there = np.abs(np.sum((fields.points / oval) ** 2, axis=1) - 1.0) < 1e-3
    x, u = fields.points[there], moved[there]
    angle = np.degrees(np.arctan2(x[:, 1], x[:, 0])) % 360
    order = np.argsort(angle)
    ours = np.column_stack(
        [np.interp(theirs.angle_deg, angle[order], each[order], period=360) for each in u.T]
    )
    expected = theirs[["x_mm", "y_mm"]].to_numpy()
    assert np.linalg.norm(ours - expected) < most * np.linalg.norm(expected)
