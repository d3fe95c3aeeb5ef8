"""Compiled motion and emission of the parcels of free jets: `round_jet_closure` for one parcel after another."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.parcels import ParcelBuffers
from wakewise.simulation.water.round_jet_closure import CORE_END_D, FIRST_D, WAKE_ENTRAINMENT

EMISSION_SPACING = 0.6  # of the first sigma: Gaussians this close add up to a smooth row (ripple below 1e-6)
GUST_MEMORY = 1.0  # integral time of the turbulence, in sigma over speed at the parcel
# A parcel keeps the velocity of the water round it until it has gone this share of its size or this long, whichever is
# sooner: young ones are looked at in every step, wide slow ones in every fourth.
_HELD_SIGMA, HELD_S = 0.05, 0.2


@njit(apart=True, nogil=True)
def parcels_to_sample(flow: Array, held_s: Array, sigma: Array, dt_s: float) -> IntArray:
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


@njit(apart=True, nogil=True)
def advect_parcels(
    X: Array,
    sigma: Array,
    share: Array,
    speed: Array,
    D: Array,
    disk: Array,
    u: Array,
    ambient: Array,
    start: Array,
    wake: np.ndarray,
    laws: Array,
    walls: Array,
) -> None:
    """Move parcels on, in place, and write the speed of the jets' water where they were, shape (n,).

    - `disk`, `u`, `ambient`, shape (n, 3): velocity of the disk that sent them, of the jets' water and of the ambient
      water at the parcels.
    - `wake`, shape (n,): which are of the hull's wake.
    - `laws`, shape (5,): growth of sigma with the path in the core, beyond it, and of a puff, the time step in s, and
      the wake's life.
    - `walls`, shape (k, 4): of each face: axis, place, side, and what is not used here. A parcel that would end behind
      one is mirrored.
    - Shapes: `X` (n, 3); `sigma`, `share`, `speed`, `D`, `start` (n,).
    """
    core_spread, puff, dt_s, shorter = laws[0], laws[2], laws[3], 1.0 - 1.0 / laws[4]
    for i in range(sigma.shape[0]):
        s, first, end = sigma[i], FIRST_D * D[i], CORE_END_D * D[i]
        speed[i] = math.sqrt(u[i, 0] ** 2 + u[i, 1] ** 2 + u[i, 2] ** 2)
        eta = (first / s) ** 2 if s < end else 0.5
        # A row that is bent over spreads as a puff.
        rr = ro = oo = rp = pp = 0.0
        for k in range(3):
            own, past = eta * u[i, k], ambient[i, k] - disk[i, k]
            row = own + past
            rr, ro, oo = rr + row * row, ro + row * own, oo + own * own
            rp, pp = rp + row * past, pp + past * past
        sine2 = min(max(1.0 - ro * ro / max(rr * oo, 1e-30), 0.0), 1.0) if rr * oo > 1e-20 else 0.0
        spread = laws[1]
        if shorter > 0.0 and not wake[i] and start[i] > 0.0:
            # `lasting_spread` of the reference (tests)
            spread *= 1.0 - shorter * max(1.0 - speed[i] / (start[i] * min(1.0, end / s)), 0.0)
        wide = spread * math.sqrt(1.0 - sine2) + puff * math.sqrt(sine2)
        path, after = travelled(s, D[i], speed[i], dt_s, core_spread, wide)
        if wake[i]:
            # `wake_sigma_m` of the reference (tests)
            rate = 3.0 * (WAKE_ENTRAINMENT - 0.5 * laws[1]) * start[i] * end * end
            after = (after**3 + rate * dt_s) ** (1.0 / 3.0)
        # `share_left` of the reference (tests); the mean of the step's ends counts.
        before = min((first / s) ** 2 if s < end else 0.25 * D[i] / s, 1.0)
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
            if walls[f, 2] * (X[i, k] - walls[f, 1]) > 0.0:
                X[i, k] = 2 * walls[f, 1] - X[i, k]


@njit(apart=True, nogil=True)
def slugs(
    impulses_m4_s: Array,
    dt_s: float,
    areas_m2: Array,
    spacing_m: Array,
    waiting_m4_s: Array,
    waiting_m: Array,
) -> tuple[IntArray, IntArray, Array, Array, Array]:
    """Parcels sent during a step at equal spacing along the slug of water that passed each disk.

    - `impulses_m4_s`, shape (n, 2): of the step, forward and reverse, over the water's density.
    - `waiting_m4_s`, `waiting_m`, shape (n, 2): impulse not yet sent, and the length of the slug that it stands for;
      updated in place.
    - Shapes: `areas_m2`, `spacing_m` (n,).

    Returns shape (k,): thruster, 1 for reverse thrust, age at the end of the step, exit speed, impulse.
    """
    many = count_sent(impulses_m4_s, dt_s, areas_m2, spacing_m, waiting_m)
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


@njit(nogil=True)
def travelled(
    sigma: float, D: float, speed: float, dt_s: float, core_spread: float, wide: float
) -> tuple[float, float]:
    """Path of one parcel and its size after it: `travel` of the reference (tests)."""
    first, end = FIRST_D * D, CORE_END_D * D
    start, left_s, path = sigma, dt_s, 0.0
    if sigma < end:
        rate = 3.0 * core_spread * speed * first**2
        cubed = sigma**3 + rate * dt_s
        beyond = cubed > end**3
        start = end if beyond else cubed ** (1.0 / 3.0)
        left_s = (cubed - end**3) / max(rate, 1e-30) if beyond else 0.0
        path = (start - sigma) / core_spread
    after = math.sqrt(start * start + wide * start * speed * left_s)
    return path + (after - start) / wide, after


@njit(nogil=True)
def fade_gusts(gust: Array, sigma: Array, speed: Array, noise: Array, dt_s: float) -> None:
    """Step of the parcels' Markov turbulence, shape (n, 3), in place, with standard normal noise."""
    for i in range(sigma.shape[0]):
        memory = math.exp(-dt_s * max(speed[i], 1e-3) / (GUST_MEMORY * sigma[i]))
        fresh = math.sqrt(1.0 - memory * memory)
        for k in range(3):
            gust[i, k] = memory * gust[i, k] + fresh * noise[i, k]


@njit(nogil=True)
def count_sent(impulses_m4_s: Array, dt_s: float, areas_m2: Array, spacing_m: Array, waiting_m: Array) -> int:
    """How many parcels `slugs` will send."""
    many = 0
    for i in range(areas_m2.shape[0]):
        for back in range(2):
            if impulses_m4_s[i, back] > 0.0:
                speed = math.sqrt(impulses_m4_s[i, back] / (dt_s * areas_m2[i]))
                many += int((waiting_m[i, back] + speed * dt_s) / spacing_m[i])
    return many


@njit(apart=True, nogil=True)
def emit_parcels(
    jets: ParcelBuffers,
    count: int,
    slugs: tuple[IntArray, IntArray, Array, Array, Array],
    areas_m2: Array,
    disks: Array,
    ambient: Array,
    laws: Array,
    walls: Array,
    noise: Array,
) -> int:
    """Write the parcels that were sent during a step behind the first `count`; how many there are then.

    - `slugs`: what `slugs` returned.
    - `disks`, shape (3, t, 3): where the disks are now, their velocities, and their force axes.
    - `ambient`, shape (t, 3): velocity of the ambient water at the disks.
    - `laws`, `walls`: as in `advect_parcels`.
    - `noise`, shape (k, 3): standard normal, for their turbulence.
    - Shapes: `areas_m2` (t,).
    """
    thruster, back, age, exit_speed, sent = slugs
    for j in range(age.shape[0]):
        i, n = thruster[j], count + j
        D = math.sqrt(4.0 * areas_m2[i] / math.pi)
        path, sigma = travelled(FIRST_D * D, D, exit_speed[j], age[j], laws[0], laws[1])
        disk_share = (FIRST_D * D / sigma) ** 2 if sigma < CORE_END_D * D else 0.25 * D / sigma
        jets.sigma[n], jets.diameter[n], jets.stream[n] = sigma, D, 2 * i + back[j]
        jets.share[n], jets.held[n], jets.start[n] = min(disk_share, 1.0), np.inf, exit_speed[j]
        towards = 1.0 if back[j] == 1 else -1.0
        for k in range(3):
            axis, disk = towards * disks[2, i, k], disks[1, i, k]
            # Its water leaves with the disk's velocity and takes on the current's.
            advected = ambient[i, k] + jets.share[n] * (disk - ambient[i, k])
            jets.position[n, k] = disks[0, i, k] + (advected - disk) * age[j] + path * axis
            jets.impulse[n, k], jets.gust[n, k] = sent[j] * axis, noise[j, k]
            jets.disk[n, k], jets.flow[n, k] = disk, 0.0
        for f in range(walls.shape[0]):
            k = int(walls[f, 0])
            over = walls[f, 2] * (jets.position[n, k] - walls[f, 1])
            if over > 0.0:
                jets.position[n, k] -= walls[f, 2] * over
    return count + age.shape[0]
