"""Flows measured by virtual PIV, and its errors: round trips of known fields, and real pairs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.vision.piv.correlation import averaged, displacements
from wakewise.vision.piv.folder import PivFolder, read_pairs, samples_of_vectors
from wakewise.vision.piv.images import CameraSettings, LightSheet, TracerSettings, photograph_pair
from wakewise.wake.samples import JetSamples, joined
from wakewise_paper.flows import JetFlow, exit_speed_m_s

SHEET = LightSheet(
    centre_W_m=np.array([0.32, 0.0, 0.0]),
    right_W=np.array([1.0, 0.0, 0.0]),
    down_W=np.array([0.0, 1.0, 0.0]),
    half_thickness_m=2e-3,
)
"""A light sheet 4 mm thick (1/e^2) through the jet's axis, its middle 0.32 m from the disk."""
CAMERA = CameraSettings(width_px=1024, height_px=896, m_per_px=0.6e-3)
FASTEST_PX = 10.0
"""The gap between pulses is shortened until the exit speed moves tracers by no more than this."""


def piv_samples(flow: JetFlow, thrusts_N: tuple[float, ...], pairs: int, rng: np.random.Generator) -> JetSamples:
    """Samples of a flow measured by virtual PIV: `pairs` image pairs per thrust at independent instants, averaged."""
    parts = []
    for thrust_N in thrusts_N:
        fastest = FASTEST_PX * CAMERA.m_per_px / (1.4 * exit_speed_m_s(thrust_N, flow.disk_diameter_m))
        camera = CAMERA.model_copy(update={"pulse_gap_s": min(1.0 / CAMERA.frame_rate_hz, fastest)})
        instants = flow.instants(thrust_N, pairs, rng)
        taken = [photograph_pair(instant, SHEET, camera, TracerSettings(), rng) for instant in instants]
        field = averaged(displacements([(pair.first, pair.second) for pair in taken]))
        view = PivFolder(
            m_per_px=camera.m_per_px,
            dt_s=camera.dt_s,
            jet_direction="right",
            disk_px=(0.5 * camera.width_px - SHEET.centre_W_m[0] / camera.m_per_px, 0.5 * camera.height_px),
            disk_diameter_m=flow.disk_diameter_m,
            thrust_N=thrust_N,
        )
        parts.append(samples_of_vectors(field, view, thrust_N, title=f"{flow.name} through PIV"))
    return joined(parts)


@dataclass(frozen=True)
class ShearFlow:
    """Water that moves at `speed_m_s` along x where y = 0 and faster by `shear_per_s` per metre of y."""

    speed_m_s: float
    shear_per_s: float

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s, shape (n, 3)."""
        out = np.zeros_like(points_W_m)
        out[:, 0] = self.speed_m_s + self.shear_per_s * points_W_m[:, 1]
        return out


@dataclass(frozen=True, kw_only=True)
class RoundTrip:
    """Errors in pixels on a synthetic pair: median and rms of |u - truth|, and the share of valid vectors."""

    field: str
    median_px: float
    rms_px: float
    bias_px: float
    valid_pct: float


def round_trip(flow: ShearFlow, rng: np.random.Generator, size_px: int = 768) -> RoundTrip:
    """Photograph a known field at 1 mm per pixel and 120 frames per second, process it and compare."""
    camera = CameraSettings(width_px=size_px, height_px=size_px, m_per_px=1e-3)
    sheet = LightSheet(
        centre_W_m=np.zeros(3),
        right_W=np.array([1.0, 0.0, 0.0]),
        down_W=np.array([0.0, 1.0, 0.0]),
        half_thickness_m=4e-3,
    )
    pair = photograph_pair(flow, sheet, camera, TracerSettings(), rng)
    found = displacements([(pair.first, pair.second)])[0]
    down_m = (found.rows_px - 0.5 * size_px) * camera.m_per_px
    truth = (flow.speed_m_s + flow.shear_per_s * down_m)[:, None] * camera.dt_s / camera.m_per_px
    error = (found.right_px - truth)[2:-2, 2:-2]  # windows at the rim see particles come and go
    words = "uniform" if flow.shear_per_s == 0.0 else f"shear {flow.shear_per_s * camera.dt_s:.4f} px/px"
    return RoundTrip(
        field=words,
        median_px=float(np.median(np.abs(error))),
        rms_px=float(np.sqrt(np.mean(error**2))),
        bias_px=float(np.mean(error)),
        valid_pct=found.valid_pct,
    )


@dataclass(frozen=True, kw_only=True)
class RealPairs:
    """Results on real pairs without a scale: figures in pixels and shares."""

    pairs: int
    valid_pct: float
    fastest_px: float
    along_jet_pct: float


def process_real_pairs(folder: Path, limit: int = 1) -> RealPairs:
    """Process pairs of a round jet that goes left; `along_jet_pct` is the share of fast vectors that go left.

    Raises
    ------
    InputError
        If the folder holds no pairs.
    """
    pairs = list(read_pairs(folder).values())[:limit]
    first = averaged(displacements(pairs))
    speed = np.hypot(first.right_px, first.down_px)
    fast = first.valid & (speed > 0.5 * np.percentile(speed[first.valid], 99))
    return RealPairs(
        pairs=len(pairs),
        valid_pct=first.valid_pct,
        fastest_px=float(np.percentile(speed[first.valid], 99)),
        along_jet_pct=100.0 * float(np.mean(first.right_px[fast] < 0.0)),
    )
