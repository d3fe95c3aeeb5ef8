"""Water and silt between scene and camera: attenuation, veil, and backscatter of the vehicle's lamps.

I = J exp(-beta_D r) + B_inf (1 - exp(-beta_B r)) along a ray of length r, with beta_D, beta_B and B_inf per colour band
(Akkaynak & Treibitz, CVPR 2018, doi 10.1109/CVPR.2018.00703). Silt adds its beam attenuation, integrated through the
field of concentration, and its own veil. Half of the attenuation by large grains is diffraction, which returns as blur.
Not modelled: ambient light that silt above the scene removes, and forward scattering in the lamps' veil.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.camera import Camera, ray_at
from wakewise.vision.imaging.forward_scatter import FORWARD_SHARE, forward_scattered, lobe_rad, mean_square_lever
from wakewise.vision.imaging.renderer import BAND_ROWS, LAMP_REFERENCE_M, Image, Lights, Render, in_threads


@njit
def sample_grid(values: Any, origin: Any, spacing: float, x: float, y: float, z: float) -> float:
    """Trilinear value of a grid at a point; zero outside."""
    u, v, w = (x - origin[0]) / spacing, (y - origin[1]) / spacing, (z - origin[2]) / spacing
    nx, ny, nz = values.shape
    if not (0.0 <= u <= nx - 1 and 0.0 <= v <= ny - 1 and 0.0 <= w <= nz - 1):
        return 0.0
    i, j, k = min(int(u), max(nx - 2, 0)), min(int(v), max(ny - 2, 0)), min(int(w), max(nz - 2, 0))
    a, b, c = u - i, v - j, w - k
    i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    low = (values[i, j, k] * (1 - a) + values[i1, j, k] * a) * (1 - b)
    low += (values[i, j1, k] * (1 - a) + values[i1, j1, k] * a) * b
    high = (values[i, j, k1] * (1 - a) + values[i1, j, k1] * a) * (1 - b)
    high += (values[i, j1, k1] * (1 - a) + values[i1, j1, k1] * a) * b
    return low * (1 - c) + high * c


@njit
def sample_levels(
    values: Any, origin: Any, spacing: float, outer: Any, outer_origin: Any, outer_spacing: float, x: float, y: float,
    z: float,
) -> float:  # fmt: skip
    """Trilinear value at a point: of the grid, outside it of the outer grid, zero outside both."""
    u, v, w = (x - origin[0]) / spacing, (y - origin[1]) / spacing, (z - origin[2]) / spacing
    nx, ny, nz = values.shape
    if 0.0 <= u <= nx - 1 and 0.0 <= v <= ny - 1 and 0.0 <= w <= nz - 1:
        return sample_grid(values, origin, spacing, x, y, z)
    return sample_grid(outer, outer_origin, outer_spacing, x, y, z)


NOTHING_M = 1e4
"""Length of a ray that meets nothing; no light passes through more water."""
BACKSCATTER_RATIO = 0.0183
"""Share of scattering that goes backward, of particles in sea water (Petzold 1972; Mobley 1994, table 3.11)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterOptics:
    """Clear water in three colour bands, red, green, blue, each shape (3,).

    `signal_per_m` is beta_D, `veil_per_m` beta_B, `backscatter_per_m` the backscattering coefficient, and `veil` B_inf
    relative to a white card under the same down-welling light.
    """

    signal_per_m: Array
    veil_per_m: Array
    backscatter_per_m: Array
    veil: Array

    def __post_init__(self) -> None:
        freeze(self, signal_per_m=(3,), veil_per_m=(3,), backscatter_per_m=(3,), veil=(3,))


# Band values from the absorption a and scattering b of Solonenko & Mobley 2015 (doi 10.1364/AO.54.005392), c = a + b.
# Weights: the mean sensitivity of 28 cameras (Jiang et al. 2013, doi 10.1109/WACV.2013.6475015) times the daylight left
# at 1 m, exp(-Kd 1 m); for the veil times B_inf(lambda). Effective coefficient over r = 0.5 m, where the photographs
# are taken: -ln(mean of exp(-c r)) / r. B_inf(lambda) = 0.33 b_b / (a + b_b), the reflectance of deep water
# (Gordon, Brown & Jacobs 1975, doi 10.1364/AO.14.000417), b_b = 0.0183 b. A test recomputes them from the tables.
_TABLE: dict[str, tuple[tuple[float, float, float], ...]] = {
    "I": ((0.207, 0.065, 0.030), (0.072, 0.037, 0.024), (0.00003, 0.00004, 0.00006), (0.0001, 0.0004, 0.0010)),
    "IB": ((0.256, 0.121, 0.096), (0.163, 0.102, 0.092), (0.00091, 0.00103, 0.00119), (0.0027, 0.0077, 0.0144)),
    "II": ((0.526, 0.450, 0.504), (0.489, 0.455, 0.511), (0.00583, 0.00705, 0.00866), (0.0162, 0.0452, 0.0800)),
    "III": ((1.080, 1.121, 1.333), (1.116, 1.153, 1.345), (0.01593, 0.01930, 0.02370), (0.0350, 0.0863, 0.1221)),
    "1C": ((0.544, 0.482, 0.577), (0.509, 0.480, 0.565), (0.00592, 0.00717, 0.00879), (0.0120, 0.0274, 0.0290)),
    "3C": ((1.160, 1.235, 1.514), (1.174, 1.241, 1.477), (0.01720, 0.02080, 0.02543), (0.0298, 0.0603, 0.0565)),
    "5C": ((1.272, 1.538, 1.937), (1.275, 1.527, 1.868), (0.02116, 0.02580, 0.03149), (0.0485, 0.0526, 0.0418)),
}


def water_types() -> list[str]:
    """Names of the Jerlov water types of `water_optics`."""
    return list(_TABLE)


def water_optics(water_type: str) -> WaterOptics:
    """Optics of a Jerlov water type, oceanic I, IB, II, III or coastal 1C, 3C, 5C.

    Raises InputError if the type is unknown.
    """
    if water_type not in _TABLE:
        raise InputError(f"water type {water_type!r}: unknown, allowed {', '.join(_TABLE)}")
    signal, veil_rate, backscatter, veil = (np.array(row) for row in _TABLE[water_type])
    return WaterOptics(signal_per_m=signal, veil_per_m=veil_rate, backscatter_per_m=backscatter, veil=veil)


@dataclass(frozen=True, kw_only=True, eq=False)
class SiltOptics:
    """Suspended grains much larger than the wavelength, so that all bands are attenuated alike.

    `single_scattering` (3,) is the share of attenuation that is scattering, in red, green, blue: pale carbonate mud,
    an assumption.
    """

    diameter_m: float = 20e-6
    density_kg_m3: float = 2710.0
    efficiency: float = 2.0
    single_scattering: Array = field(default_factory=lambda: np.array([0.965, 0.955, 0.935]))

    def __post_init__(self) -> None:
        freeze(self, single_scattering=(3,))
        if min(self.diameter_m, self.density_kg_m3, self.efficiency) <= 0.0:
            raise InputError("silt: diameter_m, density_kg_m3 and efficiency must be above 0")

    @property
    def attenuation_m2_kg(self) -> float:
        """Beam attenuation per concentration, 1.5 Q / (rho_s d): Q times the grains' cross-section per mass."""
        return 1.5 * self.efficiency / (self.density_kg_m3 * self.diameter_m)

    @property
    def backscatter_share(self) -> Array:
        """Backscattering over attenuation, shape (3,)."""
        return BACKSCATTER_RATIO * self.single_scattering

    @property
    def veil(self) -> Array:
        """Radiance of an endless cloud relative to a white card, shape (3,): 0.33 b_b / (a + b_b), as for the water."""
        absorbed = 1.0 - self.single_scattering
        return 0.33 * self.backscatter_share / (absorbed + self.backscatter_share)


@dataclass(frozen=True, kw_only=True, eq=False)
class Haze:
    """Silt and veil along coarse rays: what lies between the water's edge before the lens and each range.

    `ranges_m` (k,) along the ray; `table` (h', w', k, 4): the optical depth of the silt, then the radiance scattered
    into the ray in red, green, blue. Rays stand every `stride` pixels, the first through the image's corner (0, 0).
    """

    ranges_m: Array
    table: Image
    stride: int

    @property
    def silt_tau(self) -> Image:
        """Optical depth of the silt, shape (h', w', k)."""
        return self.table[..., 0]

    @property
    def veil(self) -> Image:
        """Radiance scattered into the ray, shape (h', w', k, 3)."""
        return self.table[..., 1:]


def haze_between(
    camera: Camera,
    X_WC: Pose,
    water: WaterOptics,
    silt_optics: SiltOptics,
    silt: ScalarGrid | None,
    lights: Lights,
    *,
    reach_m: float = 4.0,
    nodes: int = 49,
    stride: int | None = None,
) -> Haze:
    """Integrate silt and veil along coarse rays out to `reach_m` from the camera.

    Both vary slowly across the image, since the silt's grid is coarser than the strides: pixels may interpolate. The
    stride is 16 px, or a 60th of the image's width if that is more.
    """
    stride = stride or max(16, camera.width // 60)
    ranges = reach_m * np.linspace(0.0, 1.0, nodes) ** 2
    columns, rows = -(-camera.width // stride) + 1, -(-camera.height // stride) + 1
    table = np.zeros((rows, columns, nodes, 4), np.float32)
    clear = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((1, 1, 1)))
    levels = (clear if silt is None else silt).levels
    power = lights.lamp * LAMP_REFERENCE_M**2 / max(1, len(lights.lamps_C_m))

    def band(first: int) -> None:
        _march(
            first, min(first + 4, rows), table, ranges, stride, camera.row, X_WC.R, X_WC.p_m, *levels,
            silt_optics.attenuation_m2_kg, water.signal_per_m, water.veil_per_m, lights.from_above * water.veil,
            lights.from_above * silt_optics.veil, water.backscatter_per_m, silt_optics.backscatter_share,
            lights.lamps_C_m, power,
        )  # fmt: skip

    in_threads(band, range(0, rows, 4))
    return Haze(ranges_m=ranges, table=table, stride=stride)


def attenuate(
    view: Render,
    camera: Camera,
    haze: Haze,
    water: WaterOptics,
    from_above: float = 1.0,
    grains: SiltOptics | None = None,
) -> tuple[Image, Image]:
    """Lay the water over a view under light `from_above`, relative to the reference.

    Given the silt's `grains`, what they only diffract is blurred and not lost
    (`wakewise.vision.imaging.forward_scatter`), on the way from the scene as on the lamps' way to it.

    Returns `radiance`, shape (h, w, 3); `silt_per_m`, shape (h, w): mean attenuation by silt along each pixel's ray, up
    to the surface or to the reach of `haze`.
    """
    out = np.empty_like(view.radiance)
    silt_per_m = np.empty_like(view.depth_m)
    spread = grains is not None and bool(haze.silt_tau.max(initial=0.0) > 0.0)
    signal = np.empty_like(out if spread else out[:0])
    tau = np.empty_like(silt_per_m if spread else silt_per_m[:0])
    lost = 1.0 - FORWARD_SHARE if spread else 1.0

    def band(first: int) -> None:
        _apply(
            first, min(first + BAND_ROWS, camera.height), out, silt_per_m, signal, tau, lost, view.radiance,
            view.lamp_radiance, view.depth_m, haze.ranges_m, haze.table, haze.stride, camera.row, water.signal_per_m,
            water.veil_per_m, from_above * water.veil,
        )  # fmt: skip

    in_threads(band, range(0, camera.height, BAND_ROWS))
    if grains is not None and spread:
        length_m = (tau / np.maximum(silt_per_m, np.float32(1e-9))).astype(np.float32)
        lever = mean_square_lever(haze.ranges_m, haze.silt_tau, length_m[:: haze.stride, :: haze.stride])
        out += forward_scattered(signal, tau, lever, camera.focal_px * lobe_rad(grains.diameter_m))
    return out, silt_per_m


@njit(nogil=True)
def _march(
    first: int, last: int, table: Any, ranges: Any, stride: int, lens: Any, R_WC: Any, p: Any, values: Any, origin: Any,
    spacing: float, outer: Any, outer_origin: Any, outer_spacing: float, attenuation: float,
    signal: Any, veil_rate: Any, water_veil: Any, silt_veil: Any, water_back: Any,
    silt_back: Any, lamps: Any, power: float,
) -> None:  # fmt: skip
    """Midpoint rule in rows first..last-1, two steps between nodes; in a step the medium is uniform.

    Light from above: dL/ds = (beta_B B_w + c_s B_s) T. Lamps: a medium that scatters b_b backward evenly over the rear
    hemisphere returns b_b / (2 pi) of the irradiance per steradian, which is b_b / 2 relative to a white card's 1 / pi,
    and the lamp's light has come about the same way as it goes back: T squared.
    """
    _, columns, nodes, _ = table.shape
    # What clear water keeps along each step, one way at the veil's rate and out and back at the signal's.
    clear_kept, clear_kept_twice = np.empty((nodes, 3)), np.empty((nodes, 3))
    for node in range(1, nodes):
        for c in range(3):
            length = 0.5 * (ranges[node] - ranges[node - 1])
            clear_kept[node, c] = math.exp(-veil_rate[c] * length)
            clear_kept_twice[node, c] = math.exp(-2.0 * signal[c] * length)
    for row in range(first, last):
        left = np.empty(3)  # of light from above, on its way to the camera
        left_twice = np.empty(3)  # of the lamps' light, out and back
        for column in range(columns):
            sx, sy, z0 = ray_at(lens, float(column * stride), float(row * stride))
            dz = 1.0 / math.sqrt(sx * sx + sy * sy + 1.0)
            dx, dy = sx * dz, sy * dz
            # Where the water begins: at the lens, or at the outer face of the port.
            x0, y0, z0 = (lens[13] - z0) * sx, (lens[13] - z0) * sy, lens[13]
            tau = 0.0
            left[:] = 1.0
            left_twice[:] = 1.0
            for node in range(1, nodes):
                length = 0.5 * (ranges[node] - ranges[node - 1])
                for c in range(3):
                    table[row, column, node, 1 + c] = table[row, column, node - 1, 1 + c]
                for half in range(2):
                    t = ranges[node - 1] + (half + 0.5) * length
                    x, y, z = x0 + t * dx, y0 + t * dy, z0 + t * dz
                    silt = attenuation * sample_levels(
                        values, origin, spacing, outer, outer_origin, outer_spacing,
                        p[0] + R_WC[0, 0] * x + R_WC[0, 1] * y + R_WC[0, 2] * z,
                        p[1] + R_WC[1, 0] * x + R_WC[1, 1] * y + R_WC[1, 2] * z,
                        p[2] + R_WC[2, 0] * x + R_WC[2, 1] * y + R_WC[2, 2] * z,
                    )  # fmt: skip
                    lamp = 0.0
                    for m in range(lamps.shape[0]):
                        lx, ly, lz = x - lamps[m, 0], y - lamps[m, 1], z - lamps[m, 2]
                        if lz > 0.0:
                            r2 = lx * lx + ly * ly + lz * lz + 1e-4
                            lamp += power * lz / (r2 * math.sqrt(r2))
                    silt_kept = math.exp(-silt * length) if silt > 0.0 else 1.0
                    for c in range(3):
                        fade = veil_rate[c] + silt
                        source = veil_rate[c] * water_veil[c] + silt * silt_veil[c]
                        kept = clear_kept[node, c] * silt_kept
                        amount = source * left[c] * _mean_decay(fade, length, kept)
                        left[c] *= kept
                        kept_twice = clear_kept_twice[node, c] * silt_kept * silt_kept
                        if lamp > 0.0:
                            back = 0.5 * (water_back[c] + silt * silt_back[c]) * lamp
                            amount += back * left_twice[c] * _mean_decay(2.0 * (signal[c] + silt), length, kept_twice)
                        left_twice[c] *= kept_twice
                        table[row, column, node, 1 + c] += amount
                    tau += silt * length
                table[row, column, node, 0] = tau


@njit(inline="always")
def _mean_decay(rate: float, length: float, kept: float) -> float:
    """Integral of exp(-rate s) over 0..length, of which `kept` = exp(-rate length) is left."""
    x = rate * length
    return length * (1.0 - 0.5 * x) if x < 1e-6 else (1.0 - kept) / rate


@njit(inline="always")
def exp_minus(tau: float) -> float:
    """exp(-tau) of an optical depth, not negative: a 64th of it by series, then squared six times.

    Within 1e-8 of exp(-tau) itself everywhere; below exp(-60) it stays there.
    """
    x = -min(tau, 60.0) * (1.0 / 64.0)
    y = 1.0 + x * (1.0 + x * (1.0 / 2.0) * (1.0 + x * (1.0 / 3.0) * (1.0 + x * (1.0 / 4.0) * (1.0 + x * (1.0 / 5.0)))))
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    return y * y


@njit(nogil=True)
def _apply(
    first_row: int, last_row: int, out: Any, silt_per_m: Any, signals: Any, taus: Any, lost: float, radiance: Any,
    lamp_radiance: Any, depth_m: Any, ranges: Any, table: Any, stride: int, lens: Any, signal: Any, veil_rate: Any,
    water_veil: Any,
) -> None:  # fmt: skip
    w = depth_m.shape[1]
    _, columns, nodes, _ = table.shape
    last = nodes - 1
    reach = ranges[last]
    per_reach, per_stride = 1.0 / reach, 1.0 / stride
    per_gap = 1.0 / (ranges[1:] - ranges[:-1])
    line = np.empty((columns, nodes, 4), np.float32)
    lengths, silts = np.empty(w), np.empty(w)
    veils, kept, lit = np.empty((3, w)), np.empty(w), np.empty(w)
    for y in range(first_row, last_row):
        v = (y + 0.5) * per_stride
        j = int(v)
        b = np.float32(v - j)
        above, below = table[j], table[j + 1]
        for i in range(columns):
            for k in range(nodes):
                for c in range(4):
                    line[i, k, c] = above[i, k, c] + b * (below[i, k, c] - above[i, k, c])
        # In short loops over the row, so that several pixels go through at once.
        for x in range(w):
            sx, sy, _ = ray_at(lens, x + 0.5, y + 0.5)
            slant = math.sqrt(sx * sx + sy * sy + 1.0)
            lengths[x] = min(max(depth_m[y, x] - lens[13], 0.0) * slant, NOTHING_M)
        for x in range(w):
            near = min(lengths[x], reach)
            u = (x + 0.5) * per_stride
            p = np.uint64(u)
            # Nodes stand at reach * (k / last)**2.
            q = np.uint64(min(int(last * math.sqrt(near * per_reach)), last - 1))
            p1, q1 = p + np.uint64(1), q + np.uint64(1)
            a, f = u - p, min(max((near - ranges[q]) * per_gap[q], 0.0), 1.0)
            w00, w01, w10, w11 = (1 - a) * (1 - f), (1 - a) * f, a * (1 - f), a * f
            silts[x] = w00 * line[p, q, 0] + w01 * line[p, q1, 0] + w10 * line[p1, q, 0] + w11 * line[p1, q1, 0]
            veils[0, x] = w00 * line[p, q, 1] + w01 * line[p, q1, 1] + w10 * line[p1, q, 1] + w11 * line[p1, q1, 1]
            veils[1, x] = w00 * line[p, q, 2] + w01 * line[p, q1, 2] + w10 * line[p1, q, 2] + w11 * line[p1, q1, 2]
            veils[2, x] = w00 * line[p, q, 3] + w01 * line[p, q1, 3] + w10 * line[p1, q, 3] + w11 * line[p1, q1, 3]
            silt_per_m[y, x] = silts[x] / max(near, 1e-6)
        for c in range(3):
            veil = veils[c]
            for x in range(w):
                kept[x] = exp_minus(signal[c] * lengths[x] + silts[x])
            for x in range(w):
                lit[x] = kept[x]
            if lost < 1.0:
                for x in range(w):
                    lit[x] = exp_minus(signal[c] * lengths[x] + lost * silts[x])
            for x in range(w):
                lamp = lamp_radiance[y, x, c]
                seen = kept[x] * (radiance[y, x, c] - lamp + lamp * lit[x])
                out[y, x, c] = veil[x] + seen
                if lost < 1.0:
                    signals[y, x, c] = seen
                    taus[y, x] = silts[x]
        for x in range(w):
            if lengths[x] > reach:
                for c in range(3):
                    far = 1.0 - exp_minus(veil_rate[c] * (lengths[x] - reach))
                    out[y, x, c] += water_veil[c] * exp_minus(veil_rate[c] * reach + silts[x]) * far
