"""A liner between skin and socket: its shape, its law, its place in the mesh."""

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.contact.bonded import BondedSkin
from calfsocket.io.errors import InputError
from calfsocket.materials.liner import LINER_LAWS, Liner
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.limb_problem import bonded_to_limb, contact_surfaces, limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes import tags
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.lining import fitted
from calfsocket.meshes.quality import areas
from calfsocket.meshes.rings import ring_mesh
from calfsocket.meshes.section import build
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket

LIMB, HS = Limb.reference(), Socket.reference("HS")


@pytest.mark.parametrize("bonded", ["limb", "socket"])
def test_a_liner_shares_its_nodes_with_what_it_is_bonded_to_alone(bonded):
    liner = Liner(thickness=6.0, law="silicone", bonded=bonded)
    mesh = build(LIMB, HS, mesh_size("coarse"), liner)
    of = {name: mesh.cells[mesh.cell_tags == tag] for name, tag in mesh.regions.items()}
    shared = {name for name in of if np.intersect1d(of[tags.LINER], of[name]).size}
    assert shared == {tags.LINER, "skin" if bonded == "limb" else tags.SOCKET}
    fit = fitted(LIMB, HS, liner)
    area = abs(fit.lining.area - fit.bonded_to.area)
    assert areas(mesh.points[of[tags.LINER]]).sum() == pytest.approx(area, rel=1e-4)


def test_a_socket_s_law_counts_from_the_liner():
    for bonded in ("limb", "socket"):
        liner = Liner(thickness=6.0, law="gel", bonded=bonded)
        fit = fitted(LIMB, HS, liner)
        around = fitted(LIMB, HS, Liner(thickness=6.0, law="gel")).surface
        # HS takes 5 % of the area of what it is put around.
        assert fit.inner.area == pytest.approx(0.95 * around.area, rel=1e-6)
        within = fit.lining if bonded == "socket" else fit.inner
        assert fit.face is within
        assert fit.surface.area == pytest.approx(
            LIMB.skin.area if bonded == "socket" else around.area
        )


def test_undersize_shortens_fibres_along_the_surface_it_is_bonded_to():
    liner = Liner(thickness=6.0, law="gel", undersize="5 %")
    fit = fitted(LIMB, HS, liner)
    t = np.linspace(0.0, fit.bonded_to.period, 7)[:-1]
    points = fit.bonded_to.evaluate(t) + 4.0 * fit.bonded_to.normal(t)
    G = liner.stress_free(fit)(points)
    normal = fit.bonded_to.normal(t)
    along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", G, normal), normal, atol=1e-9)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", G, along), 0.95 * along, atol=1e-9)
    assert Liner(thickness=6.0, law="gel").stress_free(fit) is None


@pytest.mark.parametrize("lining", [0.0, 3.0])
def test_the_free_face_of_a_liner_is_in_contact(lining):
    layers = [("bone", 10.0, 14.0), ("skin", 14.0, 20.0)]
    if not lining:
        layers.append((tags.LINER, 20.0, 23.0))
    section = ring_mesh(MPI.COMM_SELF, layers, (22.9, 26.0), h=3.0, lining=lining)
    assert bonded_to_limb(section) == (lining == 0.0)
    inner, outer = contact_surfaces(section)
    assert tags.LINER_SURFACE in (inner, outer)
    assert {tags.SKIN_SURFACE, tags.SOCKET_INNER} >= {inner, outer} - {tags.LINER_SURFACE}


def test_the_skin_under_a_liner_has_its_traction():
    """A uniform stress: pressure along the normal, no shear; more where the liner is stretched."""
    layers = [("bone", 10.0, 14.0), ("skin", 14.0, 20.0), (tags.LINER, 20.0, 23.0)]
    section = ring_mesh(MPI.COMM_SELF, layers, (25.0, 28.0), h=3.0)
    laws = MaterialSet.paper("combined").tissue_laws() | {tags.LINER: LINER_LAWS["gel"]}
    problem: Problem = limb_problem(section, {name: laws[name] for name in section.regions})
    pressure = 0.01
    scale = problem.fields.pressure_scale.x.array
    for cell, dofs in enumerate(problem.V.sub(1).dofmap.list):
        problem.w.x.array[dofs] = -pressure / scale[cell]
    traction = BondedSkin(problem.w, section, problem.region_laws, problem.fields).traction()
    np.testing.assert_allclose(traction.pressure, pressure, rtol=1e-3)
    np.testing.assert_allclose(traction.shear, 0.0, atol=1e-2 * pressure)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"law": "silicon"}, "no liner law 'silicon'; did you mean 'silicone'?"),
        ({"law": 3}, "law: is 3; use one of silicone, urethane, gel"),
        ({"law": {"law": "ogdn"}}, "law: law is 'ogdn'"),
        ({"thickness": -1.0}, "thickness: is -1.0; it must be greater than 0"),
        ({"bonded": "skin"}, "it must be 'limb' or 'socket'"),
    ],
)
def test_bad_liners_are_refused(values, words):
    with pytest.raises(InputError, match=words.replace("?", r"\?")):
        Liner(**{"thickness": 6.0, "law": "gel", **values})
