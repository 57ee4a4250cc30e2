"""Forms are compiled for as many Ogden terms as the cases' laws have."""

import fcntl

import ffcx.codegeneration.jit
import pytest
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.materials import tissues
from calfsocket.materials.laws import Ogden, ogden_terms
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import contact_line, section_fields
from calfsocket.simulation import precompile as compilation

LAYERS = [("bone", 10.0, 14.0), ("muscle", 14.0, 29.0), ("fascia", 29.0, 30.0), ("skin", 30, 32.0)]


def test_forms_are_compiled_once_for_each_number_of_terms(monkeypatch, tmp_path):
    compiled = []
    monkeypatch.setattr(compilation, "_use_all_forms", compiled.append)
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compilation.jit, "DOLFINX_DEFAULT_JIT_OPTIONS", {})
    two = Ogden((1.0, 2.0), (3.0, -4.0), d1=0.0)
    laws = [[tissues.FASCIA], [tissues.SKIN, two], [tissues.SKIN, tissues.BONE]]
    compilation.warm(MPI.COMM_SELF, map(ogden_terms, laws))
    assert compiled == [1, 2]


@pytest.mark.parametrize("another_lives", [True, False])
def test_only_what_a_dead_process_left_half_compiled_is_thrown_away(
    another_lives, monkeypatch, tmp_path
):
    monkeypatch.setattr(compilation, "_use_all_forms", lambda _: None)
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compilation.jit, "DOLFINX_DEFAULT_JIT_OPTIONS", {})
    for name in ("half.c", "whole.c", "whole.c.cached", "marker.c.cached"):
        (tmp_path / name).touch()
    with (tmp_path / ".users").open("a") as other:
        if another_lives:
            fcntl.flock(other, fcntl.LOCK_SH)
        compilation.warm(MPI.COMM_SELF)
        assert (tmp_path / "half.c").exists() == another_lives
        assert (tmp_path / "whole.c").exists() and (tmp_path / "whole.c.cached").exists()
        assert not (tmp_path / "marker.c.cached").exists()
        with pytest.raises(BlockingIOError):  # we live: nobody else is alone
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_another_model_compiles_nothing(monkeypatch):
    """Another mesh, other laws of the same kinds and other parameters use the same compiled forms.

    UFL numbers what it makes through the process; none of that may get into a form's name.
    """

    def use(material_set, friction, h):
        section = ring_mesh(MPI.COMM_SELF, LAYERS, (31.9, 36.0), h=h)
        laws = tissues.material_set(material_set, fascia_c10="tables" if h > 4 else "printed")
        regions = {name: laws[name] for name in section.regions}
        model = limb_problem(section, regions, Contact(friction=friction))
        model.create_matrix()
        section_fields(model, {name: name for name in section.regions})
        contact_line(model)

    use("separate", 0.4, 4.0)
    compiled = []
    monkeypatch.setattr(
        ffcx.codegeneration.jit, "_compile_objects", lambda *args, **_: compiled.append(args)
    )
    use("separate", 0.3, 5.0)
    use("combined", 0.4, 4.0)
    assert not compiled
