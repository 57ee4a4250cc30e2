"""Material sets: the paper's two, changed by tissue and region, and what makes none."""

import pytest
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.materials import tissues
from calfsocket.materials.laws import Hencky, Ogden, Yeoh, material_law
from calfsocket.materials.material_set import MaterialSet
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import Socket
from calfsocket.simulation.simulation import Simulation

SOFT = material_law("neo-hookean", mu=1e-3, nu=0.4)
LIMB = {"skin": "skin", "soleus": "muscle", "crural_fascia": "fascia", "tibia": "bone"}


def test_combined_set_changes_muscle_and_fascia_only() -> None:
    separate, combined = (
        MaterialSet.paper(name).tissue_laws() for name in ("separate", "combined")
    )
    changed = {tissue for tissue in separate if separate[tissue] != combined[tissue]}
    assert changed == {"muscle", "fascia"}
    assert combined["muscle"] == combined["fascia"] == tissues.MUSCLE_AND_FASCIA


def test_fascia_variant() -> None:
    variant = MaterialSet.paper("separate", fascia_c10="tables").laws["fascia"]
    assert variant == Yeoh(c10=0.491, c20=13.59, c30=18.97)


def test_as_printed_form_of_the_set() -> None:
    """Equation (1) multiplies every Ogden modulus by alpha/2 and leaves the other laws alone."""
    abaqus = MaterialSet.paper("separate").laws
    printed = MaterialSet.paper("separate", ogden_form="as-printed").laws
    ratio = {t: printed[t].initial_shear_modulus / abaqus[t].initial_shear_modulus for t in abaqus}
    assert ratio == pytest.approx(
        {"skin": 6, "fat": 13, "muscle": 2.3, "fascia": 1, "vessel": 1, "bone": 1, "socket": 1}
    )
    assert all(printed[t].bulk_modulus == abaqus[t].bulk_modulus for t in abaqus)


def test_other_laws_by_tissue_and_region() -> None:
    custom = {"fat": SOFT, "socket": Hencky(e=2200.0, nu=0.4), "soleus": Yeoh(c10=1.0)}
    changed = MaterialSet.paper("separate", ogden_form="as-printed").replace(LIMB, **custom)
    laws = changed.region_laws(LIMB)
    assert laws["soleus"] == custom["soleus"] and laws["socket"] == custom["socket"]
    assert laws["crural_fascia"] == tissues.FASCIA
    assert changed.tissue_laws()["muscle"].form == "as-printed"
    assert changed.tissue_laws()["fat"] == SOFT  # its own form, not the option's


def test_laws_that_only_another_set_has_a_place_for() -> None:
    laws = {"muscle": SOFT, "combined": Ogden(mu=(2.0,), alpha=(3.0,), d1=1.0)}
    separate, combined = (
        MaterialSet.paper(name).replace_known(laws).tissue_laws()
        for name in ("separate", "combined")
    )
    assert separate["muscle"] == SOFT and separate["fascia"] == tissues.FASCIA
    assert combined["muscle"] == combined["fascia"] == laws["combined"]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: MaterialSet.paper("both"), "set is 'both'; use one of separate, combined"),
        (lambda: MaterialSet.paper("separate", "0.5"), "c10 is '0.5'; use one of printed, tables"),
        (
            lambda: MaterialSet.paper("separate", ogden_form="printed"),
            "ogden_form is 'printed'; use one of abaqus, as-printed",
        ),
        (lambda: MaterialSet.paper("separate").replace(fatt=SOFT), "'fatt'; did you mean 'fat'?"),
        (lambda: MaterialSet.paper("separate").replace(blood=SOFT), "allowed: skin, fat, muscle"),
        (
            lambda: MaterialSet.paper("combined").replace(muscle=SOFT),
            "no tissue or region 'muscle'",
        ),
        (lambda: MaterialSet.paper("separate").replace(LIMB, soleous=SOFT), "mean 'soleus'?"),
        (lambda: MaterialSet.paper("separate").replace(fat=3), "fat is 3; it must be a law"),
        (lambda: MaterialSet("mine", "separate", {"skin": SOFT}), "mine: fat is missing"),
        (
            lambda: MaterialSet.paper("separate").replace(
                **dict.fromkeys(("skin", "fat", "muscle", "vessel"), Yeoh(c10=1.0))
            ),
            "every soft tissue is incompressible",
        ),
    ],
)
def test_what_makes_no_set(make, says: str) -> None:
    with pytest.raises(InputError) as raised:
        make()
    assert says in str(raised.value)


def test_a_region_that_the_limb_does_not_have() -> None:
    """Regions of the reference limb may be named before there is a limb."""
    changed = MaterialSet.paper("separate").replace(tibialis_anterior=SOFT)
    with pytest.raises(InputError, match="no tissue or region 'tibialis_anterior'"):
        changed.region_laws(LIMB)


def test_what_a_wall_does_not_say_is_the_sets() -> None:
    limb, socket = Limb.reference(), Socket.reference("HS")
    paper = MaterialSet.paper("separate")
    stiff = paper.replace(socket=Hencky(e=2200.0, nu=0.35))
    for wall, materials, expected in (
        ({}, stiff, Hencky(e=2200.0, nu=0.35)),
        ({"poisson": 0.3}, stiff, Hencky(e=2200.0, nu=0.3)),
        ({"modulus": 900.0}, stiff, Hencky(e=900.0, nu=0.35)),
        ({"modulus": 900.0}, paper, Hencky(e=900.0, nu=0.4)),
        ({"modulus": 900.0}, paper.replace(socket=SOFT), Hencky(e=900.0, nu=0.4)),
    ):
        changed = socket.model_copy(update=wall)
        simulation = Simulation(limb, changed, materials, mesh_size="coarse", comm=MPI.COMM_SELF)
        assert simulation.region_laws["socket"] == expected
