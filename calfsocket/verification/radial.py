"""The exact solution of concentric rings under radial load, in plane strain.

Everything comes from `Law.energy` and `Law.kirchhoff` (principal stretches, numpy), by collocation
with one Chebyshev polynomial a ring; nothing from UFL or the finite elements.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from calfsocket.io.errors import CalfsocketError
from calfsocket.materials.laws import Law
from calfsocket.meshes import tags
from calfsocket.verification.sampling import Array, FloatArray


@dataclass(frozen=True)
class Ring:
    """A ring of one tissue: its region's name, tissue, and radii in mm."""

    name: str
    tissue: str
    inner: float
    outer: float


# Every tissue of the limb, and the order of a calf from the tibia out.
LIMB = (
    Ring("bone", "bone", 10.0, 14.0),
    Ring("muscle_deep", "muscle", 14.0, 19.0),
    Ring("fascia_intermuscular", "fascia", 19.0, 20.0),
    Ring("vessel", "vessel", 20.0, 22.0),
    Ring("muscle_superficial", "muscle", 22.0, 27.0),
    Ring("fascia_deep", "fascia", 27.0, 28.0),
    Ring("fat", "fat", 28.0, 32.0),
    Ring("skin", "skin", 32.0, 34.0),
)
SOCKET_THICKNESS = 4.5
SOCKET = "socket"

NODES = 14
"""Chebyshev nodes in a ring; twice as many change the contact pressure by 1e-15, ten by 3e-12."""


@dataclass(frozen=True)
class Profile:
    """The solution in one ring at n radii."""

    #: (n,) undeformed and deformed radius, mm
    radius: FloatArray
    deformed: FloatArray
    stretch: FloatArray  #: (2, n) radial and hoop
    stress: FloatArray  #: (3, n) Cauchy stress, radial, hoop and axial, MPa


class RingLaw:
    """A law in the radial problem: what follows from P_r and the hoop stretch.

    P_k = (tau_k + J p)/l_k, tau the law's isochoric Kirchhoff stress, p = K (J - 1) or J = 1.
    Stretches are extended to long doubles: bone's strains of 1e-6 have ten digits only in a double
    near 1, and its stress no more than them.

    From a stress-free state G = diag(G_r, G_t) the law has l_k / G_k, and P_r = G_t Pe_r,
    P_t = G_r Pe_t of its own stresses.
    """

    def __init__(self, law: Law, stress_free: tuple[float, float] = (1.0, 1.0)) -> None:
        self.law = law
        self._G = stress_free
        self.incompressible = not np.isfinite(law.bulk_modulus)

    def radial_stretch(self, nominal: Array, hoop: Array) -> Array:
        """l_r at which the law has the radial nominal stress P_r, by Newton's method."""
        G_r, G_t = self._G
        return G_r * self._radial_stretch(nominal / G_t, hoop / G_t)

    def _radial_stretch(self, nominal: Array, hoop: Array) -> Array:
        stretch = 1.0 / hoop
        if self.incompressible:
            return stretch
        for _ in range(60):
            change = (self._nominal_radial(stretch, hoop) - nominal) / _slope(
                lambda radial: self._nominal_radial(radial, hoop), stretch
            )
            stretch = stretch - change
            if np.abs(change).max() < 1e-12:  # quadratic: the next would be below rounding
                return stretch
        raise CalfsocketError(f"{self.law}: no radial stretch found for P_r = {nominal} MPa")

    def slopes(self, nominal: Array, hoop: Array) -> tuple[Array, Array, Array]:
        """Return l_r and P_t (MPa), and their derivatives by P_r and hoop stretch, (2, 2, n)."""
        G_r, G_t = self._G
        radial, P_t, slopes = self._slopes(nominal / G_t, hoop / G_t)
        return G_r * radial, G_r * P_t, G_r / G_t * slopes

    def _slopes(self, nominal: Array, hoop: Array) -> tuple[Array, Array, Array]:
        radial = self._radial_stretch(nominal, hoop)
        of_radial = np.array([np.zeros_like(hoop), -1.0 / hoop**2])
        if not self.incompressible:
            by_radial = _slope(lambda lr: self._nominal_radial(lr, hoop), radial)
            by_hoop = _slope(lambda lt: self._nominal_radial(radial, lt), hoop)
            of_radial = np.array([1.0 / by_radial, -by_hoop / by_radial])
        through = _slope(lambda lr: self._nominal_hoop(nominal, lr, hoop), radial)
        direct = _slope(lambda lt: self._nominal_hoop(nominal, radial, lt), hoop)
        of_hoop = through * of_radial + [radial / hoop, direct]
        return radial, self._nominal_hoop(nominal, radial, hoop), np.array([of_radial, of_hoop])

    def cauchy(self, nominal: Array, radial: Array, hoop: Array) -> FloatArray:
        """Cauchy stress in MPa, radial, hoop and axial; (3, n)."""
        G_r, G_t = self._G
        nominal, radial, hoop = nominal / G_t, radial / G_r, hoop / G_t
        tau = self.law.kirchhoff(_principal(radial, hoop))
        return np.asarray((nominal * radial + tau - tau[0]) / (radial * hoop), dtype=float)

    def energy(self, radial: Array, hoop: Array) -> FloatArray:
        """Return the stored energy per reference volume, MPa; (n,)."""
        G_r, G_t = self._G
        radial, hoop = radial / G_r, hoop / G_t
        energy = self.law.energy(_principal(radial, hoop))
        if not self.incompressible:
            energy = energy + 0.5 * self.law.bulk_modulus * (radial * hoop - 1.0) ** 2
        return np.asarray(G_r * G_t * energy, dtype=float)

    def _nominal_radial(self, radial: Array, hoop: Array) -> Array:
        J = radial * hoop
        tau = self.law.kirchhoff(_principal(radial, hoop))
        return np.asarray((tau[0] + J * self.law.bulk_modulus * (J - 1.0)) / radial)

    def _nominal_hoop(self, nominal: Array, radial: Array, hoop: Array) -> Array:
        tau = self.law.kirchhoff(_principal(radial, hoop))
        return np.asarray((nominal * radial - tau[0] + tau[1]) / hoop)


def _principal(radial: Array, hoop: Array) -> Array:
    radial, hoop = np.broadcast_arrays(radial, hoop)
    return np.array([radial, hoop, np.ones_like(radial)])


def _slope(function: Callable[[Array], Array], at: Array) -> Array:
    """Differentiate by a complex step: exact to rounding."""
    step = 1e-30
    return np.asarray(function(at + 1j * step).imag / step)


class RadialSolution:
    """The radial problem of nested rings, solved by collocation and Newton's method.

    In each ring the radial displacement u = r - R (mm) and the nominal stress P_r (MPa) are
    polynomials with values at Chebyshev's nodes; at all of them but the innermost

        u' = l_r(P_r, l_t) - 1,    P_r' = (P_t - P_r)/R,    l_t = 1 + u/R.

    The innermost circle is fixed; `outside` are the coefficients (a, b, c) of the condition
    a u + b P_r = c at the outermost radius. Where a ring overlaps the one before it, u has a `jump`
    in mm, and R P_r is the same on both sides. `stress_free` has (G_r, G_t) of rings whose
    stress-free state is not the undeformed one.
    """

    def __init__(
        self,
        rings: Sequence[Ring],
        laws: Mapping[str, Law],
        outside: tuple[float, float, float],
        jump: float = 0.0,
        nodes: int = NODES,
        stress_free: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.rings = list(rings)
        states = stress_free or {}
        self.laws = {
            ring.name: RingLaw(laws[ring.tissue], states.get(ring.name, (1.0, 1.0)))
            for ring in rings
        }
        self._nodes = -np.cos(np.linspace(0.0, np.pi, nodes))
        self._D = BarycentricInterpolator(self._nodes, np.eye(nodes)).derivative(self._nodes)
        x: FloatArray = np.zeros((len(rings), 2, nodes))  # ring, (u, P_r), node
        for _ in range(20):
            residual, tangent = self._system(x, outside, jump)
            # Rows of bone and of muscle differ by their moduli.
            size = np.abs(tangent).max(axis=1)
            change = np.linalg.solve(tangent / size[:, None], residual / size).reshape(x.shape)
            x = x - change
            # Quadratic convergence: what is left is the square of this change, or rounding.
            if np.all(np.abs(change) <= 1e-10 * np.abs(x).max(axis=2, keepdims=True)):
                break
        else:
            raise CalfsocketError("the radial problem has no solution near the unloaded state")
        self._x = x

    def at_end(self, name: str) -> tuple[float, float]:
        """Radial displacement (mm) and P_r (MPa) at a ring's outer radius."""
        u, nominal = self._x[self._index(name), :, -1]
        return float(u), float(nominal)

    def profile(self, name: str, radius: Array) -> Profile:
        """Return the solution in one ring."""
        ring, (u, nominal) = self.rings[self._index(name)], self._x[self._index(name)]
        at = self._radii(ring)
        u = BarycentricInterpolator(at, u)(radius)
        nominal = BarycentricInterpolator(at, nominal)(radius)
        hoop = 1.0 + np.asarray(u, dtype=np.longdouble) / radius
        law = self.laws[name]
        radial = law.radial_stretch(nominal, hoop)
        return Profile(
            radius,
            radius + u,
            np.array([radial, hoop], dtype=float),
            law.cauchy(nominal, radial, hoop),
        )

    def energy(self) -> float:
        """Return the stored energy per radian, N mm per mm, by Gauss quadrature."""
        at, weight = np.polynomial.legendre.leggauss(len(self._nodes))
        total = 0.0
        for ring in self.rings:
            half = 0.5 * (ring.outer - ring.inner)
            radius = ring.inner + half * (1.0 + at)
            density = self.laws[ring.name].energy(*self.profile(ring.name, radius).stretch)
            total += float(np.sum(half * weight * density * radius))
        return total

    def _index(self, name: str) -> int:
        return [ring.name for ring in self.rings].index(name)

    def _radii(self, ring: Ring) -> FloatArray:
        return ring.inner + 0.5 * (ring.outer - ring.inner) * (1.0 + self._nodes)

    def _system(
        self, x: FloatArray, outside: tuple[float, float, float], jump: float
    ) -> tuple[FloatArray, FloatArray]:
        """Residual and its derivative by all unknowns."""
        residual = np.zeros(x.shape)
        tangent = np.zeros((*x.shape, *x.shape))
        inner = np.arange(1, len(self._nodes))
        for k, ring in enumerate(self.rings):
            R, (u, nominal) = self._radii(ring), x[k]
            D = 2.0 / (ring.outer - ring.inner) * self._D
            hoop = 1.0 + np.asarray(u, dtype=np.longdouble) / R
            radial, P_t, slope = self.laws[ring.name].slopes(nominal, hoop)
            slope[1, 0] -= 1.0  # of P_t - P_r
            rates = np.array([radial - 1.0, (P_t - nominal) / R], dtype=float)
            by = np.array([[slope[0, 1] / R, slope[0, 0]], [slope[1, 1] / R**2, slope[1, 0] / R]])
            for i, j in np.ndindex(2, 2):
                tangent[k, i, inner, k, j, inner] -= by[i, j, 1:].astype(float)
            for i in range(2):
                residual[k, i, 1:] = (D @ x[k, i] - rates[i])[1:]
                tangent[k, i, 1:, k, i] += D[1:]
            # At the inner radius: fixed, or the neighbour's displacement and force per angle.
            tangent[k, 0, 0, k, 0, 0] = 1.0
            if k == 0:
                residual[k, 0, 0] = u[0]
                residual[k, 1, 0] = outside[0] * x[-1, 0, -1] + outside[1] * x[-1, 1, -1]
                residual[k, 1, 0] -= outside[2]
                tangent[k, 1, 0, -1, :, -1] = outside[:2]
                continue
            before = self.rings[k - 1]
            overlaps = before.outer > ring.inner
            residual[k, 0, 0] = u[0] - x[k - 1, 0, -1] - (jump if overlaps else 0.0)
            residual[k, 1, 0] = ring.inner * nominal[0] - before.outer * x[k - 1, 1, -1]
            tangent[k, 0, 0, k - 1, 0, -1] = -1.0
            tangent[k, 1, 0, k, 1, 0] = ring.inner
            tangent[k, 1, 0, k - 1, 1, -1] = -before.outer
        return residual.ravel(), tangent.reshape(x.size, x.size)


@dataclass(frozen=True)
class ExactRing:
    """Exact state of limb and socket."""

    #: contact pressure per undeformed area of the skin, MPa, as the program's contact has it
    pressure: float
    skin_radius: float  #: deformed radius of the skin, mm
    solution: RadialSolution  #: all fields; the socket is a ring with the name of its tissue


def exact_ring(
    laws: Mapping[str, Law],
    overclosure: float,
    load: float = 1.0,
    rings: Sequence[Ring] = LIMB,
    nodes: int = NODES,
    stress_free: Mapping[str, tuple[float, float]] | None = None,
    lining: float = 0.0,
) -> ExactRing:
    """Solve the radial problem of limb and socket, whose outer face is free.

    The overclosure is the skin's radius minus the socket's inner radius, undeformed, in mm, the
    load the share of it that is released, 0 to 1. Friction has no part: nothing moves around.

    `stress_free` has (G_r, G_t) of rings at full load, to which they grow in proportion. A liner
    bonded to the limb is the last of the rings; one inside the socket is `lining` mm thick, and
    what is called the socket's inner radius is then the liner's.
    """
    skin = rings[-1]
    inner = skin.outer - overclosure
    wall = inner + lining
    socket = [Ring(SOCKET, SOCKET, wall, wall + SOCKET_THICKNESS)]
    if lining:
        socket.insert(0, Ring(tags.LINER, tags.LINER, inner, wall))
    states = {
        name: (1.0 + load * (G_r - 1.0), 1.0 + load * (G_t - 1.0))
        for name, (G_r, G_t) in (stress_free or {}).items()
    }
    # Deformed radii: inner + u_socket = skin + u_skin - (1 - load) overclosure.
    solution = RadialSolution(
        [*rings, *socket],
        laws,
        outside=(0.0, 1.0, 0.0),
        jump=load * overclosure,
        nodes=nodes,
        stress_free=states,
    )
    moved, nominal = solution.at_end(skin.name)
    return ExactRing(-nominal, skin.outer + moved, solution)


def work_error(laws: Mapping[str, Law], squeeze: float, points: int = 8) -> float:
    """Relative difference between the work of a pressure on the limb and the energy it stores.

    The exact solution against itself, for the work is made of stresses and the energy of energies:
    int R_s P_r(r_s) dr_s = W, over skin radii r_s from the undeformed R_s to `squeeze` mm less, by
    Gauss-Legendre quadrature with so many points.
    """
    skin = LIMB[-1]

    def squeezed(move: float) -> RadialSolution:
        return RadialSolution(LIMB, laws, outside=(1.0, 0.0, move))

    at, weight = np.polynomial.legendre.leggauss(points)
    moves = -0.5 * squeeze * (1.0 + at)
    forces = [skin.outer * squeezed(move).at_end(skin.name)[1] for move in moves]
    work = -0.5 * squeeze * float(weight @ np.array(forces))
    return work / squeezed(-squeeze).energy() - 1.0
