"""What is compiled of a step of the parcels: when they are sent, and their motion.

The motion is `wakewise.water.closure` written out for one parcel after another; the closure's own functions are the
readable twin of the loop.
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.compiled import njit
from wakewise.water.closure import CORE_END_D, FIRST_D, PUFF_SPREAD, Spreading
from wakewise.water.faces import Face
from wakewise.water.parcels import Parcels

EMISSION_SPACING = 0.6  # of the first sigma: Gaussians this close add up to a smooth row (ripple below 1e-6)
GUST_MEMORY = 1.0  # integral time of the turbulence, in sigma over speed at the parcel
# A parcel keeps the velocity of the water round it until it has gone this share of its size or this long, whichever is
# sooner: young ones are looked at in every step, wide slow ones in every fourth.
_HELD_SIGMA, HELD_S = 0.05, 0.2


@njit
def due(flow: Array, held_s: Array, sigma: Array, dt_s: float) -> IntArray:
    """Parcels at which the water must be looked at before a step of dt_s; the times of the others go on."""
    found = np.empty(sigma.shape[0], np.int64)
    count = 0
    for i in range(sigma.shape[0]):
        held_s[i] += dt_s
        speed = math.sqrt(flow[i, 0] ** 2 + flow[i, 1] ** 2 + flow[i, 2] ** 2)
        if held_s[i] > HELD_S - 1e-9 or speed * held_s[i] > _HELD_SIGMA * sigma[i]:
            found[count] = i
            held_s[i] = 0.0
            count += 1
    return found[:count]


def drifted(
    parcels: Parcels, u_m_s: Array, ambient_m_s: Array, dt_s: float, spreading: Spreading, faces: tuple[Face, ...]
) -> tuple[Array, Array, Array, Array]:
    """Where parcels are after dt_s, shape (n, 3), their size, their disk's share, and the jets' speed where they were.

    Parameters
    ----------
    parcels : Parcels
    u_m_s, ambient_m_s : ndarray, shape (n, 3)
        Velocity of the jets and of the ambient water at the parcels.
    dt_s : float
    spreading : Spreading
    faces : tuple of Face
        A parcel that would end behind one is mirrored in it.
    """
    position, sigma, share = parcels.position_m.copy(), parcels.sigma_m.copy(), parcels.share.copy()
    speed = np.empty(parcels.count)
    walls = np.array([(face.axis, face.side, face.at_m) for face in faces], dtype=np.float64).reshape(-1, 3)
    laws = np.array([spreading.core_spread, spreading.spread, max(PUFF_SPREAD, spreading.spread), dt_s])
    _drift(position, sigma, share, speed, parcels.diameter_m, parcels.disk_m_s, u_m_s, ambient_m_s, laws, walls)
    return position, sigma, share, speed


def gust_memory(sigma_m: Array, speed_m_s: Array, dt_s: float) -> Array:
    """Share of a parcel's turbulence that is left after dt_s, shape (n, 1)."""
    memory: Array = np.exp(-dt_s * np.maximum(speed_m_s, 1e-3) / (GUST_MEMORY * sigma_m))[:, None]
    return memory


@njit
def _drift(
    X: Array,
    sigma: Array,
    share: Array,
    speed: Array,
    D: Array,
    disk: Array,
    u: Array,
    ambient: Array,
    laws: Array,
    walls: Array,
) -> None:
    core_spread, spread, puff, dt_s = laws[0], laws[1], laws[2], laws[3]
    for i in range(sigma.shape[0]):
        s, first, end = sigma[i], FIRST_D * D[i], CORE_END_D * D[i]
        speed[i] = math.sqrt(u[i, 0] ** 2 + u[i, 1] ** 2 + u[i, 2] ** 2)
        core = s < end
        eta = (first / s) ** 2 if core else 0.5
        # A row that is bent over spreads as a puff.
        rr = ro = oo = rp = pp = 0.0
        for k in range(3):
            own, past = eta * u[i, k], ambient[i, k] - disk[i, k]
            row = own + past
            rr, ro, oo = rr + row * row, ro + row * own, oo + own * own
            rp, pp = rp + row * past, pp + past * past
        sine2 = min(max(1.0 - ro * ro / max(rr * oo, 1e-30), 0.0), 1.0) if rr * oo > 1e-20 else 0.0
        wide = spread * math.sqrt(1.0 - sine2) + puff * math.sqrt(sine2)
        # `closure.travel`
        start, left_s, path = s, dt_s, 0.0
        if core:
            rate = 3.0 * core_spread * speed[i] * first**2
            cubed = s**3 + rate * dt_s
            beyond = cubed > end**3
            start = end if beyond else cubed ** (1.0 / 3.0)
            left_s = (cubed - end**3) / max(rate, 1e-30) if beyond else 0.0
            path = (start - s) / core_spread
        after = math.sqrt(start * start + wide * start * speed[i] * left_s)
        path += (after - start) / wide
        # `closure.share_left`; the mean of the step's ends counts.
        before = min((first / s) ** 2 if core else 0.25 * D[i] / s, 1.0)
        grown = min((first / after) ** 2 if after < end else 0.25 * D[i] / after, 1.0)
        across = math.sqrt(max(pp - rp * rp / max(rr, 1e-20), 0.0))
        left = min(grown / before, math.exp(-across * dt_s / (math.pi * 0.5 * (s + after))))
        kept = 0.5 * share[i] * (1.0 + left)
        share[i] *= left
        step = path / max(speed[i], 1e-12)
        for k in range(3):
            X[i, k] += step * u[i, k] + (ambient[i, k] + kept * (disk[i, k] - ambient[i, k])) * dt_s
        sigma[i] = after
        # A mirrored world is mirrored again: nothing ends up behind a face.
        for f in range(walls.shape[0]):
            k = int(walls[f, 0])
            if walls[f, 1] * (X[i, k] - walls[f, 2]) > 0.0:
                X[i, k] = 2 * walls[f, 2] - X[i, k]


@njit
def slugs(
    impulses_m4_s: Array,
    dt_s: float,
    areas_m2: Array,
    spacing_m: Array,
    waiting_m4_s: Array,
    waiting_m: Array,
) -> tuple[IntArray, IntArray, Array, Array, Array]:
    """Parcels sent during a step at equal spacing along the slug of water that passed each disk.

    Parameters
    ----------
    impulses_m4_s : ndarray, shape (n, 2)
        Of the step, forward and reverse, over the water's density.
    dt_s : float
    areas_m2, spacing_m : ndarray, shape (n,)
    waiting_m4_s, waiting_m : ndarray, shape (n, 2)
        Impulse not yet sent, and the length of the slug that it stands for; updated in place.

    Returns
    -------
    Of each parcel, shape (k,): thruster, 1 for reverse thrust, age at the end of the step, exit speed, impulse.
    """
    many = 0
    for i in range(areas_m2.shape[0]):
        for back in range(2):
            if impulses_m4_s[i, back] > 0.0:
                speed = math.sqrt(impulses_m4_s[i, back] / (dt_s * areas_m2[i]))
                many += int((waiting_m[i, back] + speed * dt_s) / spacing_m[i])
    thruster, reverse = np.empty(many, np.int64), np.empty(many, np.int64)
    age, exit_speed, sent = np.empty(many), np.empty(many), np.empty(many)
    at = 0
    for i in range(areas_m2.shape[0]):
        for back in range(2):
            if impulses_m4_s[i, back] <= 0.0:
                continue
            speed = math.sqrt(impulses_m4_s[i, back] / (dt_s * areas_m2[i]))
            slug = waiting_m[i, back] + speed * dt_s
            whole = waiting_m4_s[i, back] + impulses_m4_s[i, back]
            n = int(slug / spacing_m[i])
            share = n * spacing_m[i] / slug
            waiting_m[i, back], waiting_m4_s[i, back] = slug - n * spacing_m[i], whole * (1.0 - share)
            for k in range(n):
                thruster[at], reverse[at], exit_speed[at] = i, back, speed
                age[at] = min(max((slug - spacing_m[i] * (k + 0.5)) / speed, 0.0), dt_s)
                sent[at] = whole * share / n
                at += 1
    return thruster, reverse, age, exit_speed, sent
