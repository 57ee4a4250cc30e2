"""Forms are compiled once a kind of law."""

import fcntl

import ffcx.codegeneration.jit
import pytest
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.forms.kinematics import Jet
from calfsocket.materials.laws import Ogden
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.kernels import library
from calfsocket.mechanics.kernels.laws import signature
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import contact_line, section_fields
from calfsocket.simulation import precompile as compilation

LAYERS = [("bone", 10.0, 14.0), ("muscle", 14.0, 29.0), ("fascia", 29.0, 30.0), ("skin", 30, 32.0)]


def use(material_set, friction, h):
    section = ring_mesh(MPI.COMM_SELF, LAYERS, (31.9, 36.0), h=h)
    laws = MaterialSet.paper(material_set, "tables" if h > 4 else "printed").tissue_laws()
    regions = {name: laws[name] for name in section.regions}
    model = limb_problem(section, regions, Contact(friction=friction))
    model.create_matrix()
    section_fields(model, {name: name for name in section.regions})
    contact_line(model)


def test_each_kind_of_law_is_compiled_once(monkeypatch, tmp_path):
    compiled = []
    monkeypatch.setattr(compilation, "_use_all_forms", compiled.append)
    monkeypatch.setattr(compilation, "_compiled", set())
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compilation.jit, "DOLFINX_DEFAULT_JIT_OPTIONS", {})
    two = Ogden(mu=(1.0, 2.0), alpha=(3.0, -4.0), d1=0.0)
    paper = MaterialSet.paper("separate")
    compilation.precompile(MPI.COMM_SELF, [paper, paper.replace(skin=two), paper])
    # Once a kind of law at the skin's surface, each with all kinds within.
    assert [law.name for law, *_ in compiled] == ["ogden", "ogden"]
    assert [len(law.mu) for law, *_ in compiled] == [1, 2]
    for _, *within in compiled:
        kinds = sorted((law.name, len(law.coefficients())) for law in within)
        assert kinds == [("hencky", 1), ("ogden", 2), ("ogden", 4), ("yeoh", 3)]


def test_what_was_compiled_is_not_looked_up_again(monkeypatch, tmp_path):
    """Until a form is missing, or a law, a compiler's options or a source is another."""
    compiled = []

    def compile_one(laws):
        compiled.append(laws)
        (tmp_path / "form.so").touch()

    def another_process():
        monkeypatch.setattr(compilation, "_compiled", set())
        compilation.precompile(MPI.COMM_SELF, [paper])
        return len(compiled)

    options, paper = {}, MaterialSet.paper("combined")
    monkeypatch.setattr(compilation, "_use_all_forms", compile_one)
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compilation.jit, "DOLFINX_DEFAULT_JIT_OPTIONS", options)
    assert [another_process(), another_process()] == [1, 1]
    (tmp_path / "form.so").unlink()
    assert [another_process(), another_process()] == [2, 2]
    options["cffi_extra_compile_args"] = (["-O1"], "")
    assert [another_process(), another_process()] == [3, 3]
    source = tmp_path / "another.py"
    source.write_text("# a law")
    sources = [*compilation._sources(), source]
    monkeypatch.setattr(compilation, "_sources", lambda: sources)
    assert [another_process(), another_process()] == [4, 4]
    source.write_text("# another law")
    assert [another_process(), another_process()] == [5, 5]
    paper = paper.replace(skin=Ogden(mu=(1.0, 2.0, 3.0), alpha=(3.0, -4.0, 1.0), d1=0.0))
    assert [another_process(), another_process()] == [6, 6]


def test_laws_that_take_other_coefficients_have_other_code():
    def first(x, J, coefficients):
        return Jet(coefficients[0] * x, coefficients[0], 0.0)

    def second(x, J, coefficients):
        return Jet(coefficients[1] * x, coefficients[1], 0.0)

    assert signature((first, 2)) != signature((second, 2))
    assert signature((first, 2)) != signature((first, 3))
    assert signature((first, 2)) == signature((first, 2))


def test_the_sources_of_all_forms_are_known():
    names = {path.name for path in compilation._sources()}
    assert {"mixed.py", "interface.py", "extract.py", "cells.h", "condensation.c"} <= names


def test_precompiled_forms_are_those_of_a_case(monkeypatch):
    compilation._use_all_forms(*compilation._problems([MaterialSet.paper("separate")]))
    compiled = []
    monkeypatch.setattr(
        ffcx.codegeneration.jit, "_compile_objects", lambda *args, **_: compiled.append(args)
    )
    monkeypatch.setattr(library, "_compile", lambda *args: compiled.append(args))
    use("combined", 0.4, 4.0)
    assert not compiled


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
        compilation.precompile(MPI.COMM_SELF)
        assert (tmp_path / "half.c").exists() == another_lives
        assert (tmp_path / "whole.c").exists() and (tmp_path / "whole.c.cached").exists()
        assert not (tmp_path / "marker.c.cached").exists()
        with pytest.raises(BlockingIOError):  # we live: nobody else is alone
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_another_model_compiles_nothing(monkeypatch):
    """Another mesh, other laws of the same kinds and other parameters use the same compiled forms.

    UFL numbers what it makes through the process; none of that may get into a form's name.
    """

    use("separate", 0.4, 4.0)
    compiled = []
    monkeypatch.setattr(
        ffcx.codegeneration.jit, "_compile_objects", lambda *args, **_: compiled.append(args)
    )
    use("separate", 0.3, 5.0)
    use("combined", 0.4, 4.0)
    assert not compiled
