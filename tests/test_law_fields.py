"""Laws as fields over the cells of a mesh, on as many ranks as the test runs on."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from calfsocket.forms import hencky, ogden, yeoh
from calfsocket.io.errors import InputError
from calfsocket.materials.fields import LawFields
from calfsocket.materials.laws import Hencky, Law, Ogden, Yeoh

REGIONS = {"deep": 3, "soft": 5, "sheet": 7, "hard": 9, "absent": 11}
LAWS: dict[str, Law] = {
    "deep": Ogden(mu=(0.4, -0.05), alpha=(3.3, -2.7), d1=0.1),
    "soft": Ogden(mu=(0.012,), alpha=(4.0,), d1=2.0, form="as-printed"),
    "sheet": Yeoh(c10=1.0, c20=2.0, c30=3.0),
    "hard": Hencky(e=12.0, nu=0.2),
}


@pytest.fixture
def striped() -> tuple[mesh.Mesh, mesh.MeshTags]:
    """Unit square in four vertical strips, regions 3, 5, 7, 9 from the left."""
    domain = mesh.create_unit_square(MPI.COMM_WORLD, 8, 3)
    cells = domain.topology.index_map(2)
    local = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    x = mesh.compute_midpoints(domain, 2, local)[:, 0]
    regions = 3 + 2 * np.floor(4 * x).astype(np.int32)
    return domain, mesh.meshtags(domain, 2, local, regions)


def check(function: fem.Function, cell_tags: mesh.MeshTags, values: tuple[float, ...]) -> None:
    dofs = function.function_space.dofmap.list[cell_tags.indices, 0]
    by_region = np.array(values)[(cell_tags.values - 3) // 2]
    assert function.x.array[dofs] == pytest.approx(by_region)


def test_fields(striped) -> None:
    """A kind of law is a form with a number of coefficients; in cells of others they are 1."""
    domain, cell_tags = striped
    fields = LawFields(domain, cell_tags, REGIONS, LAWS)
    kinds = {(m.law_form, len(m.coefficients)): m for m in fields.materials.values()}
    assert kinds.keys() == {
        (ogden.energy, 2),
        (ogden.energy, 4),
        (yeoh.energy, 3),
        (hencky.energy, 1),
    }
    expected = {
        (ogden.energy, 4): [(0.4, 1, 1, 1), (3.3, 1, 1, 1), (-0.05, 1, 1, 1), (-2.7, 1, 1, 1)],
        (ogden.energy, 2): [(1, 0.012 * 4.0 / 2, 1, 1), (1, 4.0, 1, 1)],
        (yeoh.energy, 3): [(1, 1, 1, 1), (1, 1, 2, 1), (1, 1, 3, 1)],
        (hencky.energy, 1): [(1, 1, 1, 12 / 2.4)],
    }
    for kind, values in expected.items():
        for function, by_region in zip(kinds[kind].coefficients, values, strict=True):
            check(function, cell_tags, by_region)
    # D1/2 = 0.05 and 1; incompressible; 3 (1 - 2 nu)/E = 1.8/12
    check(fields.inverse_bulk, cell_tags, (0.05, 1.0, 0, 0.15))
    check(fields.pressure_scale, cell_tags, (0.35, 0.024, 2.0, 5.0))
    assert len(fields.parameters) == 2 + 4 + 3 + 1 + 2
    for name, law in LAWS.items():
        cells = cell_tags.find(REGIONS[name])
        tags = {tag for tag in fields.materials if np.isin(cells, fields.tags.find(tag)).any()}
        assert {fields.materials[tag].coefficients for tag in tags} <= {
            fields.of_region(name).coefficients
        }
        assert fields.of_region(name).law_form == type(law).energy_form


def test_kinds_have_one_order_whatever_the_regions(striped) -> None:
    domain, cell_tags = striped
    turned = dict(zip(LAWS, reversed(LAWS.values()), strict=True))
    forms = [
        [(material.law_form, len(material.coefficients)) for material in fields.materials.values()]
        for fields in (LawFields(domain, cell_tags, REGIONS, laws) for laws in (LAWS, turned))
    ]
    assert forms[0] == forms[1]


def test_other_parameters(striped) -> None:
    domain, cell_tags = striped
    fields = LawFields(domain, cell_tags, REGIONS, LAWS)
    fields.set_laws({"hard": Hencky(e=24.0, nu=0.2), "soft": Ogden(mu=(0.1,), alpha=(5,), d1=0)})
    check(fields.pressure_scale, cell_tags, (0.35, 0.1, 2.0, 10.0))
    check(fields.inverse_bulk, cell_tags, (0.05, 0, 0, 0.075))
    check(fields.of_region("soft").coefficients[1], cell_tags, (1, 5.0, 1, 1))
    with pytest.raises(ValueError, match="hard: is hencky with 1 coefficients, not yeoh with 3"):
        fields.set_laws({"hard": LAWS["sheet"]})
    with pytest.raises(ValueError, match="soft: is ogden with 2 coefficients, not ogden with 4"):
        fields.set_laws({"soft": LAWS["deep"]})


def test_every_region_needs_a_law(striped) -> None:
    laws = {name: law for name, law in LAWS.items() if name != "sheet"}
    with pytest.raises(InputError, match="no law for sheet"):
        LawFields(*striped, REGIONS, laws)


def test_every_cell_needs_a_region(striped) -> None:
    domain, cell_tags = striped
    n_owned = domain.topology.index_map(2).size_local
    keep = cell_tags.indices != n_owned - 1  # one cell missing on each rank
    partial = mesh.meshtags(domain, 2, cell_tags.indices[keep], cell_tags.values[keep])
    with pytest.raises(InputError, match=f"mesh: {MPI.COMM_WORLD.size} cells belong to no region"):
        LawFields(domain, partial, REGIONS, LAWS)


def test_ghost_cells_have_their_law(striped) -> None:
    """Also where the tags name the cells of this rank alone."""
    domain, cell_tags = striped
    owned = cell_tags.indices < domain.topology.index_map(2).size_local
    owned_tags = mesh.meshtags(domain, 2, cell_tags.indices[owned], cell_tags.values[owned])
    fields = LawFields(domain, owned_tags, REGIONS, LAWS)
    check(fields.pressure_scale, cell_tags, (0.35, 0.024, 2.0, 5.0))


def test_fields_on_the_mesh(striped) -> None:
    """Integral over the unit square, a quarter of it in each region."""
    domain, _ = striped
    scale = LawFields(*striped, REGIONS, LAWS).pressure_scale
    total = domain.comm.allreduce(fem.assemble_scalar(fem.form(scale * ufl.dx(domain))))
    assert total == pytest.approx((0.35 + 0.024 + 2.0 + 5.0) / 4)


@pytest.mark.parametrize("ranks", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_fields_on_several_ranks(ranks: int, mpirun) -> None:
    """The tests of the fields again, the mesh distributed."""
    options = ["-q", "-n0", "-p", "no:cacheprovider", "-k", "not several_ranks"]
    output = mpirun(ranks, ["-m", "pytest", *options, __file__], timeout=120)
    assert output.count("7 passed") == ranks
