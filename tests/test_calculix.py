"""Contact along the skin of TSB Combined, coarse, as CalculiX finds it from the exported deck.

The curves in data/ are CalculiX 2.20's, run once with the decks of `export --format calculix`, and
means over 3 mm along the skin: traction for each mm of undeformed length, from the nodal forces
that its stresses in the skin give.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calfsocket import Limb, MaterialSet, Simulation, Socket
from calfsocket.postprocess.contact_line import running_mean

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
