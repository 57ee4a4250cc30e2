"""In which order a direct solver eliminates unknowns: nested dissection by METIS.

A separator of few vertices, which comes last, cuts the graph in two halves, and so on. Debian's
MUMPS has not got METIS, and its own PORD orders a plane mesh of quadratic triangles so that a
factorisation has a tenth more operations, and takes five times as long to find it.

Karypis and Kumar 1998, doi:10.1137/S1064827595287997.
"""

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

IntArray = NDArray[np.int32]

_LIBRARY = "libmetis.so.5"  # of Debian, with integers of 32 bits
_SUCCESS = 1


def nested_dissection(cliques: Sequence[NDArray[np.integer]], size: int) -> IntArray | None:
    """Return the place of each vertex in the order of elimination; None where METIS is missing.

    Parameters
    ----------
    cliques : sequence of (k, m) int
        Vertices that are neighbours of each other, a row for each clique; -1 stands for none.
    weights : (n,) int
        Unknowns of each vertex.

    Raises
    ------
    RuntimeError
        If METIS fails.
    """
    metis = _metis()
    if metis is None:
        return None
    graph = _graph(cliques, size)
    place, inverse = np.empty(size, dtype=np.int32), np.empty(size, dtype=np.int32)
    arrays = (graph.indptr, graph.indices, None, None, inverse, place)
    addresses = (None if array is None else array.ctypes.data for array in arrays)
    number = ctypes.byref(ctypes.c_int32(size))
    status = metis.METIS_NodeND(number, *map(ctypes.c_void_p, addresses))
    if status != _SUCCESS:
        raise RuntimeError(f"METIS_NodeND returned {status}")
    return place


@cache
def _metis() -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(_LIBRARY)
    except OSError:
        return None


def _graph(cliques: Sequence[NDArray[np.integer]], size: int) -> sparse.csr_array:
    """Which vertices are neighbours; without loops, as METIS has it."""
    rows, columns, first = [], [], 0
    for clique in cliques:
        there = clique >= 0
        rows.append(np.nonzero(there)[0] + first)
        columns.append(clique[there])
        first += len(clique)
    row, column = np.concatenate(rows), np.concatenate(columns)
    ones = np.ones(len(row), dtype=np.int32)
    belongs = sparse.csr_array((ones, (row, column)), shape=(first, size))
    graph = sparse.csr_array(belongs.T @ belongs)
    graph.setdiag(0)
    graph.eliminate_zeros()
    graph.sort_indices()
    graph.indptr, graph.indices = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
    return graph
