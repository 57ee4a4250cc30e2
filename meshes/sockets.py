"""The two faces of a socket, from the law of its inner face and its wall."""

from collections.abc import Sequence

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.data import Bump, CircleBlend, NormalOffset, Outline, Shape, Socket
from calfsocket.meshes.loops import CROSSING_POINTS, at, crossing_of, polar_angle

_REMEDIES = {
    "normal_offset": "use smaller or wider bumps",
    "circle_blend": "use smaller or wider bumps",
    "outline": "correct its points",
}


def socket_faces(socket: Socket, skin: ClosedCurve) -> tuple[ClosedCurve, ClosedCurve]:
    """Return the inner and the outer face of a socket for a limb of this skin outline.

    Raises
    ------
    InputError
        When a face crosses itself, or the wall is thicker than the inner face is hollow.
    """
    thickness = socket.wall_thickness
    try:
        inner = inner_face(socket.shape, skin)
        _check_face(inner, "the inner face crosses itself", _REMEDIES[socket.shape.law])
        _check_wall(inner, thickness)
        outer = curves.offset(inner, lambda points: np.full(len(points), thickness))
        _check_face(
            outer,
            f"the outer face crosses itself, for a wall of {thickness:g} mm does not fit,",
            "make the wall thinner or the hollow there wider",
        )
    except InputError as error:
        raise InputError(f"socket {socket.name}: {error}") from error
    return inner, outer


def inner_face(shape: Shape, skin: ClosedCurve) -> ClosedCurve:
    """Return the inner face of a socket for a limb of this skin outline."""
    match shape:
        case NormalOffset():
            return normal_offset(shape, skin)
        case CircleBlend():
            return circle_blend(shape, skin)
        case Outline():
            return placed(shape)


def _check_face(face: ClosedCurve, what: str, remedy: str) -> None:
    crossing = crossing_of(face)
    if crossing is not None:
        raise InputError(f"{what} at {at(crossing)}; {remedy}")
    if face.area <= 0:
        raise InputError("a face runs clockwise; give its points counter-clockwise")


def _check_wall(inner: ClosedCurve, thickness: float) -> None:
    """Refuse a wall that folds over: where the face is hollow with a smaller radius."""
    t = inner.sample(inner.perimeter / CROSSING_POINTS)
    # 1/mm, negative where the wall's material is squeezed together towards the outside.
    curvature = inner.curvature(t)
    worst = int(np.argmin(curvature))
    if 1 + thickness * curvature[worst] <= 0:
        raise InputError(
            f"a wall of {thickness:g} mm folds over: the inner face is hollow with a radius of"
            f" {-1 / curvature[worst]:.2g} mm at {at(inner.evaluate(t[worst]))}; make the wall"
            " thinner or the hollow wider"
        )


def bumps_at(bumps: Sequence[Bump], angle: Array) -> Array:
    r"""Return the sum of Gaussian bumps at polar angles in degrees.

    .. math:: \sum_k a_k \exp\left(-\tfrac12
        \left(\frac{\mathrm{wrap}_{180}(\theta - \theta_k)}{w_k}\right)^2\right)

    Parameters
    ----------
    bumps
        Amplitudes a in mm, centres and widths w in degrees.
    angle
        Polar angles in degrees, shape (n,).

    Returns
    -------
    Array
        Sum in mm, shape (n,).
    """
    total = np.zeros_like(angle)
    for bump in bumps:
        turn = (angle - bump.center + 180.0) % 360.0 - 180.0
        total += bump.amplitude * np.exp(-0.5 * (turn / bump.width) ** 2)
    return total


def normal_offset(shape: NormalOffset, skin: ClosedCurve) -> ClosedCurve:
    """Return the skin moved inward along its normal by base + bumps."""
    return curves.offset(
        skin, lambda points: -(shape.base + bumps_at(shape.bumps, polar_angle(points)))
    )


def circle_blend(shape: CircleBlend, skin: ClosedCurve) -> ClosedCurve:
    r"""Return the skin blended with a circle, at a given loss of enclosed area.

    .. math:: \rho(\theta) = k b(\theta) - s(\theta),
        \quad b = (1 - c)\, r(\theta) + c\, \bar r

    with r the polar radius of the skin about the origin, its mean over the polar angle, c the
    roundness, s the bumps, and k such that the area, half the integral of rho^2 over the angle,
    is (1 - area_reduction) times the limb's. That is a quadratic equation in k.
    """

    def polar(t: Array) -> tuple[Array, Array]:
        """Return the polar radius of the skin and the derivative of its polar angle."""
        point, velocity = skin.evaluate(t), skin.evaluate(t, 1)
        radius = np.linalg.norm(point, axis=-1)
        turning = point[..., 0] * velocity[..., 1] - point[..., 1] * velocity[..., 0]
        return radius, turning / radius**2

    mean_radius = skin.integrate(lambda t: np.prod(polar(t), axis=0)) / (2 * np.pi)

    def blend(t: Array) -> Array:
        return (1 - shape.roundness) * polar(t)[0] + shape.roundness * mean_radius

    def bumps(t: Array) -> Array:
        return bumps_at(shape.bumps, polar_angle(skin.evaluate(t)))

    bb = skin.integrate(lambda t: blend(t) ** 2 * polar(t)[1]) / 2
    bs = skin.integrate(lambda t: blend(t) * bumps(t) * polar(t)[1]) / 2
    ss = skin.integrate(lambda t: bumps(t) ** 2 * polar(t)[1]) / 2
    excess = ss - (1 - shape.area_reduction) * skin.area
    if bs**2 < bb * excess:
        raise InputError(
            f"no circle blend with these bumps has an area reduced by {shape.area_reduction:g}; use"
            " smaller bumps"
        )
    k = (bs + np.sqrt(bs**2 - bb * excess)) / bb

    def exact(t: Array) -> Array:
        point = skin.evaluate(t)
        radius = k * blend(t) - bumps(t)
        return point * (radius / np.linalg.norm(point, axis=-1))[:, None]

    return curves.interpolated(exact, skin.knots)


def placed(shape: Outline) -> ClosedCurve:
    """Return the spline through an outline's points, turned and shifted."""
    turn = np.deg2rad(shape.rotation)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return curves.through(np.asarray(shape.points) @ rotation + np.asarray(shape.shift))
