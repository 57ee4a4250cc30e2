"""The second code: its laws, the comparison with it, and the limb in both."""

import numpy as np
import pytest

from calfsocket import cli
from calfsocket.io.errors import SolveError
from calfsocket.materials.laws import Hencky, Ogden, Yeoh
from calfsocket.materials.material_set import MaterialSet
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.simulation import precompile
from calfsocket.verification import page, peer
from calfsocket.verification.peer import Places, Skin

with_getfem = pytest.mark.skipif(bool(peer.missing()), reason=peer.INSTALL)


# -- GetFEM's laws


@with_getfem
def test_laws_in_getfems_language_have_the_stress_of_their_closed_forms():
    laws = [
        *MaterialSet.paper("separate").laws.values(),
        Ogden(mu=(0.03, -0.01), alpha=(2.0, -3.5), d1=0.2),
        Ogden(mu=(0.2,), alpha=(12.0,), nu=0.5),
        Ogden(mu=(0.2,), alpha=(12.0,), d1=0.2, form="as-printed"),
        Yeoh(c10=1.0, c20=-0.5, c30=2.0),
        Hencky(e=3.0, nu=0.5),
    ]
    errors = peer.law_errors(laws)
    assert len(errors) == len(laws)
    assert errors.max() < peer.LAW_BAR


@with_getfem
def test_what_getfem_says_last_is_passed_on():
    law = {"law": "gent"}
    with pytest.raises(SolveError, match=r"^GetFEM: .*no law gent"):
        peer.run_getfem({"laws": [law]}, gradients=peer.GRADIENTS)


# -- the comparison

RADIUS, THICKNESS, POINTS = 40.0, 2.0, 400


def ring(radius, n):
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


@pytest.fixture(scope="module")
def places():
    """Points on a round skin, and inside it in two layers, one of which has twice the area."""
    surface, length = ring(RADIUS, POINTS), 2.0 * np.pi * RADIUS
    layers = [ring(RADIUS - share * THICKNESS, POINTS) for share in (0.25, 0.75)]
    zero = np.zeros(POINTS)
    line = ContactLine(
        arc_mm=length * (np.arange(POINTS) + 0.5) / POINTS,
        angle_deg=360.0 * (np.arange(POINTS) + 0.5) / POINTS,
        x_mm=surface[:, 0],
        y_mm=surface[:, 1],
        pressure_kPa=zero,
        shear_kPa=zero,
        gap_mm=zero,
        weight_mm=np.full(POINTS, length / POINTS),
        status=np.full(POINTS, "stick"),
    )
    area = np.repeat([1.0, 2.0], POINTS)
    return Places(line, surface, np.vstack(layers), area, ring(RADIUS - THICKNESS, POINTS))


@pytest.fixture(scope="module")
def ours():
    angle = 2.0 * np.pi * (np.arange(POINTS) + 0.5) / POINTS
    return Skin(
        pressure=10.0 + np.cos(angle),
        shear=np.sin(3.0 * angle),
        mises=np.full(2 * POINTS, 20.0),
        displacement=np.zeros((POINTS, 2)),
    )


def with_changes(skin, **changes):
    return Skin(**{**vars(skin), **changes})


def as_getfem(places, skin, order):
    """Write a solution as `getfem_limb` does, MPa, with its points in another order."""
    normal = places.surface / RADIUS
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    traction = 1e-3 * (skin.shear[:, None] * along - skin.pressure[:, None] * normal)
    stress = np.zeros((2 * POINTS, 4))
    stress[:, 3] = 1e-3 * skin.mises / np.sqrt(3.0)  # simple shear
    twice = np.append(order, POINTS + order)
    return {
        "skin_points": places.surface[order],
        "normal": normal[order],
        "traction": traction[order],
        "stress_points": places.inside[twice],
        "stress": stress[twice],
        "nodes": places.nodes[order],
        "displacement": skin.displacement[order],
    }


def test_points_are_found_by_their_place(places, ours):
    moved = with_changes(ours, displacement=places.nodes / 100.0)
    order = np.random.default_rng(1).permutation(POINTS)
    found = places.skin(as_getfem(places, moved, order))
    for name, values in vars(moved).items():
        np.testing.assert_allclose(getattr(found, name), values, atol=1e-12, err_msg=name)


def test_another_mesh_is_refused(places, ours):
    solved = as_getfem(places, ours, np.arange(POINTS))
    with pytest.raises(ValueError, match="the meshes differ"):
        places.skin(solved | {"nodes": solved["nodes"] + 1e-3})


def test_equal_solutions_do_not_differ(places, ours):
    assert set(peer.differences(places, ours, ours).values()) == {0.0}


def test_differences_are_shares_of_the_first_solution(places, ours):
    found = peer.differences(places, ours, with_changes(ours, pressure=1.01 * ours.pressure))
    assert found["mean pressure"] == pytest.approx(1.0)
    assert found["pressure, rms"] == pytest.approx(1.0)
    assert found["pressure, 3 mm means, rms"] == pytest.approx(1.0)
    assert found["shear over pressure"] == pytest.approx(100.0 * (1.0 / 1.01 - 1.0))
    assert found["shear, rms"] == found["skin Mises, rms"] == found["nodes apart, mm"] == 0.0

    found = peer.differences(places, ours, with_changes(ours, shear=-ours.shear))
    assert found["shear, rms"] == pytest.approx(200.0)
    assert found["shear over pressure"] == pytest.approx(0.0)


def test_noise_shows_at_the_points_and_not_in_means(places, ours):
    noise = np.where(np.arange(POINTS) % 2, 0.5, -0.5)
    found = peer.differences(places, ours, with_changes(ours, pressure=ours.pressure + noise))
    assert found["pressure, rms"] == pytest.approx(5.0, rel=0.01)
    assert found["pressure, 3 mm means, rms"] < 1.0


def test_stress_counts_by_area(places, ours):
    mises = ours.mises + np.repeat([0.0, 2.0], POINTS)
    found = peer.differences(places, ours, with_changes(ours, mises=mises))
    assert found["skin Mises, rms"] == pytest.approx(10.0 * np.sqrt(2.0 / 3.0))
    np.testing.assert_allclose(places.through_skin(mises), 20.0 + 2.0 * 2.0 / 3.0)


# -- without GetFEM


@pytest.fixture
def no_getfem(monkeypatch):
    monkeypatch.setattr(peer, "find_spec", lambda name: None)


def test_the_subject_alone_says_how_to_install(no_getfem, tmp_path, capsys):
    assert cli.main(["verify", "--only", "peer", "--out", str(tmp_path)]) == 2
    output, errors = capsys.readouterr()
    (line,) = errors.splitlines()
    assert output == ""
    assert "verify --only peer: GetFEM is not installed" in line
    assert "apt-get install python3-getfem" in line
    assert list(tmp_path.iterdir()) == []


def test_all_subjects_leave_it_out_and_say_so(no_getfem, monkeypatch, tmp_path, capsys):
    asked = []
    monkeypatch.setattr(precompile, "precompile", lambda comm: None)
    monkeypatch.setattr(page, "write_page", lambda folder, subjects, _: asked.extend(subjects) or 1)
    assert cli.main(["verify", "--out", str(tmp_path)]) == 0
    assert asked == [subject for subject in page.SUBJECTS if subject != "peer"]
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("verify: the section peer is left out: GetFEM is not installed")


# -- the limb


@with_getfem
@pytest.mark.slow
@pytest.mark.parametrize("socket", peer.SOCKETS)
def test_the_limb_is_the_same_in_both_codes(socket):
    ours = peer.solve(socket, "coarse")
    theirs, effort = ours.by_getfem()
    found = peer.differences(ours.places, ours.skin, theirs)
    assert effort.steps == ours.effort.steps
    assert all(abs(found[name]) < bar for name, bar in peer.BARS[peer.OWN].items()), found
    # Friction is on in both: without it the shear would be all of the difference.
    assert found["shear, rms"] < 10.0
    assert found["nodes apart, mm"] < 0.1
