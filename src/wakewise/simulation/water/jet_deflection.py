"""Jets that come up to a solid body: they go round it at their own speed, and what strikes it turns aside.

A body answers the jets' water with sources (`wakewise.simulation.water.blockage`), as if the flow were a potential one.
Parcels that were simply carried by the sum of both would come to rest where it stagnates, with all their impulse, and
the next ones with them: what the body is answered with would grow without a bound. No water does that, for two reasons.

*Round it.* A jet's outer streamlines lie in water at rest and keep its pressure, so a jet that is turned keeps its
speed (G. I. Taylor 1960, Proc. R. Soc. A 259, 1, for jets on plates, from memory). And water that has passed the
widest place of a blunt body does not close in behind it: it separates. So a parcel goes at the speed of the jets' own
water, in the direction of the whole water, less what of the answer would draw it to the body.

*Strikes.* Of a slipstream that is wider than the body only a part meets it. Each piece of the surface that faces a
parcel's impulse, of area dA and normal n, lies in the share

    dA (-n . m/|m|) exp(-r^2 / 2 sigma^2) / (2 pi sigma^2)

of it, r its distance from the line along the impulse. What has come up to the surface, within 1.7 to 0.3 sigma of it as
on the bed (`bedjets.STRIKE_HEIGHT`), is lost to the body's pressure, and as much goes off sideways, where the parcel is
going. Shapes with hollows have more surface than meets a jet: each piece counts for the hull's area over the shape's.

What it has not: friction on the surface, a jet that clings to it, or a sheet that runs out to all sides at once: a
parcel stays one. What that comes to is held against the lattice in `wakewise.simulation.tank.validation_limits`.
"""

from __future__ import annotations

import math

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.blockage import PackedBlockage

_BEFORE, _WITHIN = 1.0, 0.7  # sigma before the surface where half of what strikes has turned, and over how many it does
_REACH = 3.0  # standard deviations beyond which nothing meets a surface
_SLIGHT = 1e-3  # of the jets' own speed: a lesser answer turns nothing
_LEAST_LEFT = 0.05  # of the slipstream: what is left of it can still strike


@njit(nogil=True)
def deflect_velocity(body: PackedBlockage, x: Array, u: Array, answer: Array) -> None:
    """Turn the velocity u of the jets' own water at a parcel, in place, the way that the body's answer there says.

    All shape (3,); `answer` is changed as well.
    """
    before = ahead = after = 0.0
    for k in range(3):
        before += u[k] ** 2
        after += answer[k] ** 2
    if before == 0.0 or after <= _SLIGHT**2 * before:
        return
    _draw_none(body, x, answer)
    after = 0.0
    for k in range(3):
        ahead += u[k] * (u[k] + answer[k])
    back = min(ahead / before, 0.0)
    for k in range(3):
        answer[k] += (1.0 - back) * u[k]
        after += answer[k] ** 2
    if after > 1e-12 * before:
        kept = math.sqrt(before / after)
        for k in range(3):
            u[k] = kept * answer[k]


@njit(nogil=True)
def _draw_none(body: PackedBlockage, x: Array, answer: Array) -> None:
    """Take from the answer at x what of it points to the body: against the normals near by, the nearest most."""
    P, N = body.points, body.normals
    a = b = c = 0.0
    for k in range(P.shape[0]):
        dx, dy, dz = x[0] - P[k, 0], x[1] - P[k, 1], x[2] - P[k, 2]
        gap2 = dx * dx + dy * dy + dz * dz + body.piece
        weight = 1.0 / (gap2 * gap2)
        a, b, c = a + weight * N[k, 0], b + weight * N[k, 1], c + weight * N[k, 2]
    size2 = a * a + b * b + c * c
    inward = a * answer[0] + b * answer[1] + c * answer[2]
    if inward < 0.0:
        answer[0] -= inward / size2 * a
        answer[1] -= inward / size2 * b
        answer[2] -= inward / size2 * c


@njit(nogil=True)
def strike_body(body: PackedBlockage, before: Array, x: Array, flow: Array, sigma: float, impulse: Array) -> float:
    """Turn aside what of a parcel strikes the body on its way from `before` to `x`; the length its impulse loses.

    Parameters
    ----------
    before, x, flow : ndarray, shape (3,)
        Places in m, and where the parcel is going.
    sigma : float
        In m.
    impulse : ndarray, shape (3,)
        In m4/s, changed in place.
    """
    size = math.sqrt(impulse[0] ** 2 + impulse[1] ** 2 + impulse[2] ** 2)
    if size == 0.0:
        return 0.0
    a, b, c = impulse[0] / size, impulse[1] / size, impulse[2] / size
    dx, dy, dz = body.ball[0] - x[0], body.ball[1] - x[1], body.ball[2] - x[2]
    ahead = a * dx + b * dy + c * dz
    near, far = body.radius + _REACH * sigma, body.radius + (_BEFORE + _REACH * _WITHIN) * sigma
    if not -near < ahead < far or dx * dx + dy * dy + dz * dz - ahead * ahead > near * near:
        return 0.0
    way = a * (x[0] - before[0]) + b * (x[1] - before[1]) + c * (x[2] - before[2])
    if way <= 0.0:
        return 0.0
    struck, striking = _met(body, x, a, b, c, sigma)
    left = math.exp(-striking * way / max(1.0 - struck, _LEAST_LEFT))
    straight = a * flow[0] + b * flow[1] + c * flow[2]
    sx, sy, sz = flow[0] - straight * a, flow[1] - straight * b, flow[2] - straight * c
    across = math.sqrt(sx * sx + sy * sy + sz * sz)
    turned = size * (1.0 - left) / across if across > 0.0 else 0.0
    impulse[0] = impulse[0] * left + turned * sx
    impulse[1] = impulse[1] * left + turned * sy
    impulse[2] = impulse[2] * left + turned * sz
    return size - math.sqrt(impulse[0] ** 2 + impulse[1] ** 2 + impulse[2] ** 2)


@njit(nogil=True)
def _met(body: PackedBlockage, x: Array, a: float, b: float, c: float, sigma: float) -> tuple[float, float]:
    """Share of a slipstream along (a, b, c) that has met the body when its parcel is at x, and its growth per metre."""
    P, N = body.points, body.normals
    per = 1.0 / sigma
    struck = striking = 0.0
    for k in range(P.shape[0]):
        facing = -(a * N[k, 0] + b * N[k, 1] + c * N[k, 2])
        if facing <= 0.0:
            continue
        dx, dy, dz = per * (P[k, 0] - x[0]), per * (P[k, 1] - x[1]), per * (P[k, 2] - x[2])
        ahead = a * dx + b * dy + c * dz
        aside2 = dx * dx + dy * dy + dz * dz - ahead * ahead
        come = (_BEFORE - ahead) / _WITHIN
        if aside2 > _REACH * _REACH or come < -_REACH:
            continue
        share = facing * math.exp(-0.5 * aside2)
        struck += share * (0.5 * math.erfc(-math.sqrt(0.5) * come) if come < _REACH else 1.0)
        striking += share * math.exp(-0.5 * come * come)
    each = body.piece * per * per / (2.0 * math.pi)
    return each * struck, each * striking * per / (_WITHIN * math.sqrt(2.0 * math.pi))
