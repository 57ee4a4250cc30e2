"""Closest point of a deformed chain of quadratic edges: where skin meets socket."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# An edge of a C2 curve is nearly straight, so Newton on its parameter needs a handful of steps.
# What a step of this tolerance leaves is its square.
_NEWTON_STEPS = 25
_NEWTON_TOLERANCE = 1e-9
# Vertices closer than this share of the chain's size are one.
_SAME_POINT = 1e-9
_SEARCH_POINTS = np.array([-0.75, -0.25, 0.25, 0.75])
_ARC_POINTS, _ARC_WEIGHTS = np.polynomial.legendre.leggauss(8)


def shape_functions(xi: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Quadratic shape functions of an edge and their first and second derivatives.

    Parameters
    ----------
    xi : (n,)
        Edge parameter, -1 at the first vertex, 1 at the second, 0 at the mid-side node.

    Returns
    -------
    N, dN, ddN : (n, 3) each
        In the order first vertex, second vertex, mid-side node.
    """
    one = np.ones_like(xi)
    values = np.stack([0.5 * xi * (xi - 1), 0.5 * xi * (xi + 1), 1 - xi**2], axis=-1)
    first = np.stack([xi - 0.5, xi + 0.5, -2 * xi], axis=-1)
    second = np.stack([one, one, -2 * one], axis=-1)
    return values, first, second


@dataclass(frozen=True)
class Projection:
    """Closest points of n skin points on the socket curve.

    Attributes
    ----------
    edge : (n,)
        Edge of the curve.
    xi : (n,)
        Parameter on that edge; slightly outside [-1, 1] only where the deformed curve has a kink.
    point, tangent, normal : (n, 2)
        Closest point in mm; unit tangent, counter-clockwise along the socket; unit normal, out of
        the socket and into the limb.
    first, second : (n, 2)
        Derivatives of the curve with respect to xi, in mm.
    arc : (n,)
        Arc length of the closest point along the *undeformed* socket, in mm: a material
        coordinate, so that its change is an objective slip.
    darc : (n,)
        Derivative of ``arc`` with respect to xi, in mm.
    beyond : (n,) bool
        Past an end of an open chain, where there is no partner.
    """

    edge: IntArray
    xi: FloatArray
    point: FloatArray
    tangent: FloatArray
    normal: FloatArray
    first: FloatArray
    second: FloatArray
    arc: FloatArray
    darc: FloatArray
    beyond: NDArray[np.bool_]


@dataclass(frozen=True)
class EdgeChain:
    """A chain of quadratic edges: the socket's inner face, the skin, or the face of a plate.

    A closed chain runs counter-clockwise. An open one has its body on its right, as that of a
    socket's inner face is, so that the normal on the left points out of the body.

    Attributes
    ----------
    reference : (n_edges, 3, 2)
        Undeformed nodes of each edge in mm: first vertex, second vertex, mid-side node.
        The second vertex of an edge is the first of the next.
    start : (n_edges,)
        Undeformed arc length at each edge's first vertex, in mm.
    length : float
        Undeformed length of the whole chain, in mm.
    closed : bool
        Whether the last edge ends where the first begins.
    """

    reference: FloatArray
    start: FloatArray
    length: float
    closed: bool

    @classmethod
    def from_edges(cls, reference: FloatArray) -> "EdgeChain":
        """Measure a chain of edges that is already ordered, as `order_chain` does."""
        lengths = _partial_length(reference, np.ones(len(reference)))
        start = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        total = float(lengths.sum())
        opening = float(np.linalg.norm(reference[-1, 1] - reference[0, 0]))
        return cls(reference, start, total, closed=opening < _SAME_POINT * total)

    def arc(self, edge: IntArray, xi: FloatArray) -> FloatArray:
        """Undeformed arc length from the start of the chain to xi on an edge, in mm."""
        return self.start[edge] + _partial_length(self.reference[edge], xi)

    def around(self, edge: IntArray, reach: int) -> IntArray:
        """Return the edges up to `reach` before and behind; (n, 2 reach + 1), at open ends fewer.

        Where an open chain ends, its last edge stands for those that are missing.
        """
        near = edge[:, None] + np.arange(-reach, reach + 1)
        n_edges = len(self.start)
        return near % n_edges if self.closed else np.clip(near, 0, n_edges - 1)

    def project(self, points: FloatArray, displacement: FloatArray) -> Projection:
        """Project points on the deformed curve.

        Parameters
        ----------
        points : (n, 2)
            Deformed skin points, in mm.
        displacement : (n_edges, 3, 2)
            Displacement of the nodes of each edge, in mm.

        Notes
        -----
        The closest point solves (x - y(xi)) . y'(xi) = 0. Candidates are the edge with the
        nearest sample point and its two neighbours. Where the chain of deformed edges has a kink,
        no edge or two edges may hold the closest point; the extended edge that is overrun least,
        or the closer one, is taken, so that the projection is smooth on either side of a switch.
        """
        nodes = self.reference + displacement
        samples = np.einsum("sa,eac->esc", shape_functions(_SEARCH_POINTS)[0], nodes)
        _, nearest = cKDTree(samples.reshape(-1, 2)).query(points)
        centre = nearest // len(_SEARCH_POINTS)
        candidates = self.around(centre, 1)
        xi, distance = _closest_on_edges(points[:, None, :], nodes[candidates])
        overrun = np.maximum(np.abs(xi) - 1.0, 0.0)
        # First the least overrun, then the least distance: both are zero or equal only on ties.
        order = np.lexsort((distance, overrun), axis=1)[:, 0]
        rows = np.arange(len(points))
        edge = candidates[rows, order]
        return self._describe(edge, xi[rows, order], nodes[edge])

    def stay(
        self,
        at: Projection,
        points: FloatArray,
        displacement: FloatArray,
        edge: IntArray,
        beyond: FloatArray,
    ) -> Projection:
        """Move points to the closest ones of given edges, if those are not too far beyond the ends.

        Arguments as of `project`, and its result; edges (n,), or -1 for a point that does not move;
        how far beyond the ends of each, as a share of half an edge (n,).
        """
        rows = np.flatnonzero(edge >= 0)
        nodes = (self.reference + displacement)[edge[rows]]
        xi = _closest_on_edges(points[rows, None, :], nodes[:, None])[0][:, 0]
        near = np.abs(xi) <= 1.0 + beyond[rows]
        if not near.any():
            return at
        rows = rows[near]
        other = self._describe(edge[rows], xi[near], nodes[near])
        values = {field.name: getattr(at, field.name).copy() for field in fields(at)}
        for name, value in values.items():
            value[rows] = getattr(other, name)
        return Projection(**values)

    def _describe(self, edge: IntArray, xi: FloatArray, nodes: FloatArray) -> Projection:
        middle, slope, bend = _polynomial(nodes)
        at = xi[:, None]
        first = slope + 2.0 * at * bend
        tangent = first / np.hypot(first[:, :1], first[:, 1:])
        _, slope_before, bend_before = _polynomial(self.reference[edge])
        before = slope_before + 2.0 * at * bend_before
        past_end = ((edge == 0) & (xi < -1)) | ((edge == len(self.start) - 1) & (xi > 1))
        return Projection(
            edge=edge,
            xi=xi,
            point=middle + at * (slope + at * bend),
            tangent=tangent,
            normal=np.stack([-tangent[:, 1], tangent[:, 0]], axis=1),
            first=first,
            second=2.0 * bend,
            arc=self.arc(edge, xi),
            darc=np.hypot(before[:, 0], before[:, 1]),
            beyond=past_end & (not self.closed),
        )

    def slip(self, arc: FloatArray, previous: FloatArray) -> FloatArray:
        """Signed arc length from `previous` to `arc`, in mm; round a closed chain the short way."""
        if not self.closed:
            return arc - previous
        half = 0.5 * self.length
        return (arc - previous + half) % self.length - half


def order_chain(
    edges: FloatArray, inside: FloatArray | None = None
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Order loose edges into a chain.

    A closed chain runs counter-clockwise and starts at the largest x. An open one starts at the end
    from which its body is on the right, as that of a socket's inner face is.

    Parameters
    ----------
    edges : (n_edges, 3, 2)
        Nodes of each edge: two vertices in any order, then the mid-side node, in mm.
    inside : (n_edges, 2), optional
        A point of the body beside each edge, in mm; an open chain needs it.

    Returns
    -------
    order, flipped
        Edge indices along the chain, and for each whether its two vertices change places.

    Raises
    ------
    ValueError
        If the edges do not form one chain, or form an open one without `inside`.
    """
    vertices = edges[:, :2].reshape(-1, 2)
    scale = np.ptp(vertices, axis=0).max()
    tree = cKDTree(vertices)
    pairs = tree.query_pairs(_SAME_POINT * scale, output_type="ndarray")
    partner = np.full(len(vertices), -1)
    partner[pairs[:, 0]] = pairs[:, 1]
    partner[pairs[:, 1]] = pairs[:, 0]
    ends = np.flatnonzero(partner < 0)
    if len(pairs) != len(edges) - len(ends) // 2 or len(ends) not in (0, 2):
        raise ValueError(f"{len(edges)} edges do not form a chain of edges")
    if len(ends) == 0:
        # The start depends on geometry alone, so that every partition walks the same chain.
        middle = edges[:, 2]
        start = 2 * int(np.lexsort((middle[:, 1], -middle[:, 0]))[0])
    elif inside is None:
        raise ValueError(f"{len(edges)} edges do not form a closed chain of edges")
    else:
        start = int(ends[0])
    walk = [start]
    while (here := int(partner[walk[-1] ^ 1])) not in (-1, start):
        walk.append(here)
    if len(walk) != len(edges):
        raise ValueError(f"{len(edges)} edges form more than one chain")
    chain, flip = np.divmod(np.array(walk), 2)
    flip = flip.astype(bool)
    if len(ends) == 0:
        polygon = edges[chain, 2]
        if _turning(polygon, np.roll(polygon, -1, axis=0)).sum() < 0:
            # Walk the other way round, from the same edge.
            chain = np.roll(chain[::-1], 1)
            flip = np.roll(~flip[::-1], 1)
    elif inside is not None:
        first, second = along_chain(edges, chain, flip)[0, :2]
        if _turning(second - first, inside[chain[0]] - first) > 0:
            chain, flip = chain[::-1], ~flip[::-1]
    return chain, flip


def _turning(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of (..., 2) vectors: > 0 where b is on the left of a."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def along_chain(
    edge_values: NDArray[Any], order: IntArray, flipped: NDArray[np.bool_]
) -> NDArray[Any]:
    """Sort (n_edges, 3, 2) values at the nodes of loose edges along the chain of `order_chain`."""
    node_order = np.where(flipped[:, None], [1, 0, 2], [0, 1, 2])
    return np.take_along_axis(edge_values[order], node_order[:, :, None], axis=1)


def _polynomial(nodes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Coefficients a, b, c (..., 2) of y(xi) = a + b xi + c xi^2 on edges (..., 3, 2)."""
    first, second, middle = np.moveaxis(nodes, -2, 0)
    return middle, 0.5 * (second - first), 0.5 * (first + second) - middle


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Scalar product of (..., 2) vectors."""
    return one[..., 0] * other[..., 0] + one[..., 1] * other[..., 1]


def _closest_on_edges(points: FloatArray, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stationary parameter and distance on each candidate edge; shapes (n, k).

    With y(xi) = a + b xi + c xi^2 and d = x - a, (x - y) . y' is a cubic polynomial:

        d.b + (2 d.c - b.b) xi - 3 b.c xi^2 - 2 c.c xi^3.
    """
    middle, b, c = _polynomial(nodes)
    d = points - middle
    db, dc, bb, bc, cc = _dot(d, b), _dot(d, c), _dot(b, b), _dot(b, c), _dot(c, c)
    linear = 2 * dc - bb
    xi = np.zeros(np.broadcast_shapes(db.shape, bb.shape))
    for _ in range(_NEWTON_STEPS):
        residual = db + xi * (linear - xi * (3 * bc + 2 * cc * xi))
        slope = linear - 6 * xi * (bc + cc * xi)
        # Beyond its centre of curvature a distant edge has no closest point; it loses anyway.
        step = -residual / np.where(slope < 0, slope, -(bb + 4 * xi * (bc + cc * xi)))
        xi, before = np.clip(xi + step, -3.0, 3.0), xi
        if np.abs(xi - before).max(initial=0.0) < _NEWTON_TOLERANCE:
            break
    offset = d - xi[..., None] * (b + xi[..., None] * c)
    return xi, np.hypot(offset[..., 0], offset[..., 1])


def _partial_length(edges: FloatArray, xi: FloatArray) -> FloatArray:
    """Arc length of each edge from its first vertex to xi, in mm (8-point Gauss)."""
    half = 0.5 * (xi + 1.0)
    at = -1.0 + half[:, None] * (_ARC_POINTS + 1.0)
    _, b, c = _polynomial(edges)
    first = b[:, None, :] + 2.0 * at[:, :, None] * c[:, None, :]
    return half * (np.hypot(first[..., 0], first[..., 1]) @ _ARC_WEIGHTS)
