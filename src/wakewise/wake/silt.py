"""What the jets lift from the bed and how much of it hangs between camera and target, as a controller sees it.

A jet of thrust T that strikes the bed squarely from the distance H stresses it most at 0.14 H from the strike point,

    tau_m = 0.16 rho U0^2 (d / H)^2 = 0.16 (4 / pi) |T| / H^2,

beyond the end of its core at 6.3 d (S. Beltaos and N. Rajaratnam, J. Hydraul. Div. ASCE 100 (1974) HY10, 1313; the
core: G. J. Hanson and K. R. Cook, Appl. Eng. Agric. 20 (2004) 455); farther out the stress goes with the square of the
wall jet's speed, hence with 1 / r^2. A bed that gives up M (tau / tau_c - 1) per area and second (E. Partheniades,
J. Hydraul. Div. ASCE 91 (1965) HY1) then loses, summed over all of it and with p = tau_m / tau_c,

    dm/dt = M pi (0.14 H)^2 p ln p,  nothing for p <= 1.

The first factors are linear in |T| and know no H: what a strike lifts is what a given momentum lifts, more from nearby
only by the logarithm. A slanting jet spreads the same momentum over other angles, so its sum is the same. The logarithm
is frozen at the last thrust of each jet; of one that rests at the root mean square of all, since it would be nothing
there, and load would jump to it and back at every step. So the rate is linear in the split thrusts, and the optical
depth a quadratic form of s = sqrt|T|, a diagonal one.

A current carries the jet aside before it strikes: its water goes on average at half the speed of the axis,
K sqrt(T / rho) / x (`RoundJet`), so it is on the way for H^2 / (K sqrt(T / rho)).

Each second's silt is a puff. It goes out with its wall jet's front, r^2 = rc^2 + 2 (1.16 / sqrt 2) sqrt(T / rho) t from
the radius rc = 0.14 H sqrt p up to which the bed moves (the layer's water goes at 1 / sqrt 2 of its greatest speed); it
drifts with the current; it is a Gaussian of the standard deviation r / 2, that of an even disk; the mean momentum of a
slanting jet lies cos psi ahead, and so does the puff; it is as thick as the layer, 0.09 r, and sinks out of that.
Its line integral along the rays from camera to target, over all ages up to `AGES_S`, is the optical depth that a
steady jet would keep there, by 1.5 * 2 / (rho_s d) of attenuation per mass (large grains take twice their section).

Left out: what wall jets do where they meet, which throws silt up; what is already in the water; strips of bed without
silt. Nothing here is the simulated tank's: kinds of bed are what a person sees, with the middle of published figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wakewise.arrays import Array, freeze
from wakewise.geometry import Pose
from wakewise.physics import FRESH_WATER_KG_M3
from wakewise.wake.floor import HALF_THICKNESS, LEAST_SINE, ROUND_DECAY, WALL_SPEED

BedKind = Literal["silt", "fresh-mud", "fluff"]
"""Beds that give up what stays in the water. Sand does not: it sinks centimetres per second."""

STRESS = 0.16 * 4.0 / np.pi
"""tau_m H^2 / |T| under a round jet (Beltaos and Rajaratnam 1974)."""
PEAK_AT = 0.14
"""Distance of the greatest stress from the strike point over H (the same)."""
CORE_DIAMETERS = 6.3
"""Length of a jet's core over its diameter (Hanson and Cook 2004)."""
RUNS = WALL_SPEED / np.sqrt(2.0)
"""Speed of a wall jet's water, averaged over its layer, times r / sqrt(T / rho)."""
AGES_S, AGES = 40.0, 10
"""How old silt is followed, a grain of 20 um sinks 15 mm in it, and by how many ages, denser where it is young."""
RAY_STEPS = 6
"""Places on each ray."""
DEPTH_WORTH_M2_S2 = 5e-3
"""Mean square water speed that counts as much as an optical depth of one. A depth of 0.02 is the least that an eye can
notice, since it takes 2 % of the contrast (S. Q. Duntley, J. Opt. Soc. Am. 38 (1948) 237, after Koschmieder); 1 cm/s is
the speed from which water at a target counts as stirred. The two are set equal: (0.01 m/s)^2 / 0.02."""


@dataclass(frozen=True, kw_only=True)
class SiltBed:
    """What a kind of bed is believed to be: threshold, M of its erosion, sinking speed, attenuation per mass."""

    threshold_Pa: float
    erosion_kg_m2_s: float
    settling_m_s: float
    attenuation_m2_kg: float


BEDS: dict[BedKind, SiltBed] = {
    # Loose carbonate of 20 um: Soulsby 1997 (SC 77, SC 102); M of silts 1e-5 to 1e-4.
    "silt": SiltBed(threshold_Pa=0.063, erosion_kg_m2_s=5e-5, settling_m_s=3.7e-4, attenuation_m2_kg=55.0),
    # Mud that settled days ago: middle of 0.037 to 0.305 Pa (Witt et al. 2024, doi 10.3389/fmars.2024.1386081).
    "fresh-mud": SiltBed(threshold_Pa=0.106, erosion_kg_m2_s=1e-4, settling_m_s=3e-4, attenuation_m2_kg=140.0),
    # The loose layer of recent deposits: 0.025 to 0.05 Pa (Schaaff et al. 2007, J. Hydraul. Eng. 133, 1087).
    "fluff": SiltBed(threshold_Pa=0.035, erosion_kg_m2_s=1e-4, settling_m_s=3e-4, attenuation_m2_kg=140.0),
}
"""Beds by the name that a person gives them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Strikes:
    """Where 2 n jets meet the bed (slot i thruster i with T > 0, slot n + i the same with T < 0).

    `lands`, shape (2 n,), tells which do; `places_W_m`, shape (2 n, 2); `reach_m`, shape (2 n,), the way H along the
    jet; `ahead_W`, shape (2 n, 2), the level part of the jet's unit direction: cos psi towards its heading.
    """

    lands: Array
    places_W_m: Array
    reach_m: Array
    ahead_W: Array


def strikes(origins_W_m: Array, axes_W: Array, bed_z_m: float) -> Strikes:
    """Where jets meet the bed, from disks and unit force axes in the world, shape (n, 3) each."""
    origins, d = np.concatenate([origins_W_m, origins_W_m]), np.concatenate([-axes_W, axes_W])
    lands = (d[:, 2] >= LEAST_SINE) & (origins[:, 2] < bed_z_m)
    reach = np.where(lands, (bed_z_m - origins[:, 2]) / np.where(lands, d[:, 2], 1.0), np.inf)
    finite = np.where(lands, reach, 0.0)
    return Strikes(lands=lands, places_W_m=origins[:, :2] + finite[:, None] * d[:, :2], reach_m=reach, ahead_W=d[:, :2])


def peak_stress_Pa(thrust_N: Array, reach_m: Array, area_m2: Array) -> Array:
    """Greatest stress on the bed under jets of |T|, from a distance along the jet, of disks of an area; any shape."""
    core = CORE_DIAMETERS * np.sqrt(4.0 * np.asarray(area_m2) / np.pi)
    return np.asarray(STRESS * np.abs(thrust_N) / np.maximum(reach_m, core) ** 2)


def lifted_kg_s_N(thrust_N: Array, reach_m: Array, area_m2: Array, bed: SiltBed) -> Array:
    """What a bed gives up per second and newton under such jets; nothing below the threshold; any shape."""
    over = np.maximum(peak_stress_Pa(thrust_N, reach_m, area_m2) / bed.threshold_Pa, 1.0)
    return np.asarray(bed.erosion_kg_m2_s * np.pi * PEAK_AT**2 * STRESS / bed.threshold_Pa * np.log(over))


def depth_of_source(
    places_W_m: Array,
    ahead_W: Array,
    start_m: Array,
    run_m2_s: Array,
    current_W_m_s: Array,
    bed_z_m: float,
    eye_W_m: Array,
    seen_W_m: Array,
    bed: SiltBed,
) -> Array:
    """Optical depth per kg/s that steady sources on the bed keep on the rays, mean over them, shape (k,).

    Parameters
    ----------
    places_W_m, ahead_W : ndarray, shape (k, 2)
        Strike points, and by how much of their way the puffs go ahead, as a vector.
    start_m : ndarray, shape (k,)
        Radius of each puff when it leaves the bed.
    run_m2_s : ndarray, shape (k,)
        How fast half the square of its radius grows.
    current_W_m_s : ndarray, shape (3,)
    bed_z_m : float
    eye_W_m : ndarray, shape (3,)
    seen_W_m : ndarray, shape (m, 3)
        Ends of the rays.
    bed : SiltBed
    """
    # Ages at the middles of intervals that grow evenly: young puffs are small and change fast.
    edges = AGES_S * np.linspace(0.0, 1.0, AGES + 1) ** 2
    ages, lasts = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    along = (np.arange(RAY_STEPS) + 0.5) / RAY_STEPS
    points = (eye_W_m + along[:, None, None] * (seen_W_m - eye_W_m)).reshape(-1, 3)
    length = np.tile(np.linalg.norm(seen_W_m - eye_W_m, axis=1) / RAY_STEPS, RAY_STEPS)
    radius = np.sqrt(start_m[:, None] ** 2 + 2.0 * run_m2_s[:, None] * ages)
    thick, width2 = HALF_THICKNESS * radius, 0.25 * radius**2
    gone = (radius - start_m[:, None])[..., None] * ahead_W[:, None, :] + ages[:, None] * current_W_m_s[:2]
    middle = places_W_m[:, None, :] + gone
    away = points[:, :2] - middle[:, :, None, :]
    height = np.maximum(bed_z_m - points[:, 2], 0.0)
    fade = 0.5 * np.einsum("kapx,kapx->kap", away, away) / width2[..., None] + height / thick[..., None]
    left = lasts * np.exp(-bed.settling_m_s * ages / thick) / (2.0 * np.pi * width2 * thick)
    mean: Array = bed.attenuation_m2_kg * np.einsum("ka,kap,p->k", left, np.exp(-fade), length) / len(seen_W_m)
    return mean


def silt_gram(
    origins_W_m: Array,
    axes_W: Array,
    areas_m2: Array,
    thrusts_N: Array,
    bed_z_m: float,
    current_W_m_s: Array,
    eye_W_m: Array,
    seen_W_m: Array,
    bed: SiltBed,
) -> Array:
    """Matrix S of the optical depth s' S s that steady jets would keep on the rays, diagonal and not negative.

    Parameters
    ----------
    origins_W_m, axes_W : ndarray, shape (n, 3)
        Disks and unit force axes in the world.
    areas_m2 : ndarray, shape (n,)
    thrusts_N : ndarray, shape (n,)
        The last ones, by which the threshold is reckoned with.
    bed_z_m : float
    current_W_m_s : ndarray, shape (3,)
        As it is believed.
    eye_W_m : ndarray, shape (3,)
        The camera.
    seen_W_m : ndarray, shape (m, 3)
        What it looks at.
    bed : SiltBed

    Returns
    -------
    ndarray, shape (2 n, 2 n), per N
    """
    n = len(origins_W_m)
    S = np.zeros((2 * n, 2 * n))
    thrust = np.concatenate([np.maximum(thrusts_N, 0.0), np.maximum(np.negative(thrusts_N), 0.0)])
    thrust[thrust == 0.0] = np.sqrt(np.mean(np.square(thrusts_N)))
    found = strikes(origins_W_m, axes_W, bed_z_m)
    areas = np.concatenate([areas_m2, areas_m2])
    lifted = lifted_kg_s_N(thrust, found.reach_m, areas, bed)
    k = np.flatnonzero(found.lands & (lifted > 0.0))
    if not len(k):
        return S
    reach, root = found.reach_m[k], np.sqrt(thrust[k] / FRESH_WATER_KG_M3)
    places = found.places_W_m[k] + (reach**2 / (ROUND_DECAY * root))[:, None] * current_W_m_s[:2]
    start = PEAK_AT * reach * np.sqrt(peak_stress_Pa(thrust[k], reach, areas[k]) / bed.threshold_Pa)
    depth = depth_of_source(
        places, found.ahead_W[k], start, RUNS * root, current_W_m_s, bed_z_m, eye_W_m, seen_W_m, bed
    )
    S[k, k] = lifted[k] * depth
    return S


@dataclass(frozen=True, kw_only=True, eq=False)
class SiltView:
    """A bed of silt, the rays from a vehicle's camera to a target, and the vehicle's thrusters."""

    bed: SiltBed
    bed_z_m: float
    eye_B_m: Array
    seen_W_m: Array
    positions_B_m: Array
    axes_B: Array
    areas_m2: Array

    def __post_init__(self) -> None:
        n = len(self.positions_B_m)
        freeze(self, eye_B_m=(3,), seen_W_m=(None, 3), positions_B_m=(n, 3), axes_B=(n, 3), areas_m2=(n,))

    def gram(self, X_WB: Pose, thrusts_N: Array, current_W_m_s: Array) -> Array:
        """What is added to the matrix of a mean D over the target, shape (2 n, 2 n), in (m/s)^2/N."""
        return DEPTH_WORTH_M2_S2 * silt_gram(
            X_WB.apply(self.positions_B_m),
            self.axes_B @ X_WB.R.T,
            self.areas_m2,
            thrusts_N,
            self.bed_z_m,
            current_W_m_s,
            X_WB.apply(self.eye_B_m[None])[0],
            self.seen_W_m,
            self.bed,
        )
