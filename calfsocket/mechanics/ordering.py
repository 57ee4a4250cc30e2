"""In which order a direct solver eliminates: nested dissection by METIS.

A separator of few vertices, which comes last, cuts the graph in two halves, and so on. Debian's
MUMPS is built without METIS, and its own ordering, PORD, leaves 18 % more operations to each
factorisation of a mesh of 30 000 triangles. MUMPS of PyPI has METIS inside.

Karypis and Kumar 1998, doi:10.1137/S1064827595287997.
"""

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

IntArray = NDArray[np.int32]

_LIBRARY = "libmetis.so.5"  # of Debian, whose integers have 32 bits
_SUCCESS = 1


def nested_dissection(cliques: Sequence[IntArray]) -> IntArray | None:
    """Return the place of each vertex in the order of elimination, or None where METIS is missing.

    Parameters
    ----------
    cliques : sequence of (k, m) int
        Vertices that are neighbours of each other, a row for each clique.

    Returns
    -------
    (n,) int
        By number of the vertex; 0 for numbers that are in no clique.

    Raises
    ------
    RuntimeError
        If METIS fails.
    """
    metis = _metis()
    if metis is None:
        return None
    vertices, graph = _graph(cliques)
    n = len(vertices)
    inverse, place = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    no_weights = default_options = None
    arrays = (graph.indptr, graph.indices, no_weights, default_options, inverse, place)
    status = metis.METIS_NodeND(ctypes.byref(ctypes.c_int32(n)), *map(_address, arrays))
    if status != _SUCCESS:
        raise RuntimeError(f"METIS_NodeND returned {status}")
    everywhere = np.zeros(vertices[-1] + 1, dtype=np.int32)
    everywhere[vertices] = place
    return everywhere


@cache
def _metis() -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(_LIBRARY)
    except OSError:
        return None


def _address(array: IntArray | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def _graph(cliques: Sequence[IntArray]) -> tuple[IntArray, sparse.csr_array]:
    """Numbers of the vertices, and which are neighbours; without loops, as METIS has it."""
    sizes = np.concatenate([np.full(len(clique), clique.shape[1]) for clique in cliques])
    row = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)
    vertices, column = np.unique(
        np.concatenate([clique.ravel() for clique in cliques]), return_inverse=True
    )
    shape = len(sizes), len(vertices)
    member = sparse.csr_array((np.ones(len(row), dtype=np.int32), (row, column)), shape=shape)
    graph = sparse.csr_array(member.T @ member)
    graph.setdiag(0)
    graph.eliminate_zeros()
    graph.sort_indices()
    graph.indptr, graph.indices = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
    return vertices, graph
