"""Forms are compiled for as many Ogden terms as the cases' laws have."""

from mpi4py import MPI

from calfsocket import compilation, tissues
from calfsocket.laws import Ogden, ogden_terms


def test_forms_are_compiled_once_for_each_number_of_terms(monkeypatch, tmp_path):
    compiled = []
    monkeypatch.setattr(compilation, "_use_all_forms", compiled.append)
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compilation.jit, "DOLFINX_DEFAULT_JIT_OPTIONS", {})
    two = Ogden((1.0, 2.0), (3.0, -4.0), d1=0.0)
    laws = [[tissues.FASCIA], [tissues.SKIN, two], [tissues.SKIN, tissues.BONE]]
    compilation.warm(MPI.COMM_SELF, map(ogden_terms, laws))
    assert compiled == [1, 2]
