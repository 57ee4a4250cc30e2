"""Work that is no part of calfsocket: its time makes those of two machines comparable."""

import time

import numpy as np
from scipy.linalg import lu_factor

REPEATS = 5
SIZE, POINTS, WORDS = 700, 400_000, 300_000
"""Of a dense matrix, of an array that does not fit into a cache, and of a dictionary."""


def unit() -> float:
    """Return the processor time of the work in s: factorise, gather and sort, interpret."""
    return min(_once() for _ in range(REPEATS))


def _once() -> float:
    random = np.random.default_rng(1)
    matrix = random.random((SIZE, SIZE)) + SIZE * np.eye(SIZE)
    values, places = random.random(POINTS), random.integers(0, POINTS, POINTS)
    start = time.process_time()
    for _ in range(3):
        lu_factor(matrix)
    np.sort(values[places])
    counted: dict[int, int] = {}
    for word in range(WORDS):
        counted[word % 1000] = counted.get(word % 1000, 0) + word
    return time.process_time() - start
