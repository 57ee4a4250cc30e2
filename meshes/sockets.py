"""The two faces of a socket, from the law of its inner face and its wall."""

from collections.abc import Sequence

import numpy as np

from calfsocket.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.data import Bump, CircleBlend, NormalOffset, Outline, Socket, SocketShape
from calfsocket.meshes.loops import is_simple, polar_angle


def socket_faces(socket: Socket, skin: ClosedCurve) -> tuple[ClosedCurve, ClosedCurve]:
    """Return the inner and the outer face of a socket for a limb of this skin outline."""
    inner = inner_face(socket.shape, skin)
    outer = curves.offset(inner, lambda points: np.full(len(points), socket.wall_thickness))
    for face, curve in (("inner", inner), ("outer", outer)):
        if not (curve.area > 0 and is_simple(curve.evaluate(curve.sample(curve.perimeter / 400)))):
            raise InputError(
                f"socket {socket.name}: the {face} face crosses itself; use smaller or wider bumps"
            )
    return inner, outer


def inner_face(shape: SocketShape, skin: ClosedCurve) -> ClosedCurve:
    """Return the inner face of a socket for a limb of this skin outline."""
    match shape:
        case NormalOffset():
            return normal_offset(shape, skin)
        case CircleBlend():
            return circle_blend(shape, skin)
        case Outline():
            return curves.through(shape.points)


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
    k = (bs + np.sqrt(bs**2 - bb * excess)) / bb

    def exact(t: Array) -> Array:
        point = skin.evaluate(t)
        radius = k * blend(t) - bumps(t)
        return point * (radius / np.linalg.norm(point, axis=-1))[:, None]

    return curves.interpolated(exact, skin.knots)
