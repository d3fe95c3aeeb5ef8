"""What particle image velocimetry sees at the target in a flight: pictures of tracers, with and without the vehicle.

A camera looks squarely at a sheet of light that stands upright through the target, in the plane of the vehicle. At some
instants of the flight the water is photographed, and the same water as it would be without the vehicle; what the
vectors differ by, near the target, is the vehicle's. A tenth of a pixel of noise is some millimetres a second here:
slower wash than that no such measurement sees.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.interfaces import Flow, TruthProvider
from wakewise.experiments.campaigns.flights import FlightProbe
from wakewise.operation import Parts
from wakewise.operation.loop import Step
from wakewise.scene.targets import Target
from wakewise.vision.piv.correlation import displacements
from wakewise.vision.piv.images import CameraSettings, LightSheet, TracerSettings, photograph_pair
from wakewise_paper.routes import SETTLE_S

NEAR_M, CLEAR_M = 0.05, 0.004
"""Vectors count within this of the target's surface, and no nearer, where a window is half full of coral."""
CAMERA = CameraSettings(width_px=320, height_px=288, m_per_px=0.6e-3)
PIV = f"{__name__}:PivProbe"
FIGURES = ("piv_speed_m_s", "piv_floor_m_s", "piv_error_m_s", "piv_true_speed_m_s", "piv_valid_pct")


@dataclass(frozen=True, eq=False)
class _Shifted:
    """The water's own motion, or all of it, as a flow."""

    water: Any
    excess: bool

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s, shape (n, 3)."""
        own = _ambient(self.water, points_W_m)
        return own + self.water.excess_velocity(points_W_m) if self.excess else own


def _ambient(water: Any, points_W_m: Array) -> Array:
    ask = getattr(water, "ambient_velocity", None)
    return np.zeros_like(points_W_m) if ask is None else np.asarray(ask(points_W_m))


class PivProbe(FlightProbe):
    """Photographs the water of a flight at `instants` spread evenly over it after its settling."""

    def __init__(self, parts: Parts, folder: Path, instants: int, duration_s: float | None = None) -> None:
        super().__init__(parts, folder)
        lasts_s = duration_s or parts.route.duration_s
        out = parts.start.X_WB.p_m - parts.target.centre_W_m
        along = np.array([out[0], out[1], 0.0])
        self._recorder = PivRecorder(
            target=parts.target,
            sheet=LightSheet(
                centre_W_m=parts.target.centre_W_m - [0.0, 0.0, 0.02],
                right_W=along / np.linalg.norm(along),
                down_W=np.array([0.0, 0.0, 1.0]),
                half_thickness_m=4e-3,
            ),
            times_s=list(SETTLE_S + (lasts_s - SETTLE_S) * (np.arange(instants) + 0.5) / max(instants, 1)),
            rng=np.random.default_rng([parts.scenario.seed, 37]),
        )

    def step(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Photograph the water if it is time."""
        self._recorder.look(step.time_s, truth_provider)

    def figures(self, steps: pl.DataFrame) -> dict[str, float]:
        """Those of the recorder."""
        del steps
        return self._recorder.figures()


@dataclass(eq=False)
class PivRecorder:
    """Photographs the water at given times."""

    target: Target
    sheet: LightSheet
    times_s: list[float]
    rng: np.random.Generator
    rows: list[tuple[float, float, float, float, float]] = field(default_factory=list)

    def look(self, time_s: float, truth_provider: TruthProvider | None) -> None:
        """Photograph the water if it is time."""
        if not self.times_s or time_s < self.times_s[0] or truth_provider is None:
            return
        self.times_s.pop(0)
        self.rows.append(self._measured(getattr(truth_provider, "tank", truth_provider)))

    def figures(self) -> dict[str, float]:
        """Means over the instants; none of no instant.

        They are: speed of the difference near the target, the same of two pictures of the water without the vehicle
        (what the method reads where there is nothing), the median error of a vector, the true speed at the same places,
        and the share of vectors that passed PIV's own tests.
        """
        if not self.rows:
            return {}
        return dict(zip(FIGURES, (float(v) for v in np.mean(self.rows, axis=0)), strict=True))

    def _measured(self, tank: Any) -> tuple[float, float, float, float, float]:
        water = getattr(tank, "water", tank)
        source = tank if callable(water) else water  # a world without memory answers itself
        whole, own, again = (_Shifted(source, excess) for excess in (True, False, False))
        seen, valid, places = self._velocities(whole)
        still, fine, _ = self._velocities(own)
        twice, true_too, _ = self._velocities(again)
        use = self._near(places) & valid & fine & true_too
        if not use.any():
            return (float("nan"),) * 4 + (0.0,)
        truth = self.sheet.to_local(source.excess_velocity(places[use]))[:, :2]
        difference = (seen - still)[use]
        return (
            float(np.linalg.norm(difference, axis=1).mean()),
            float(np.linalg.norm((twice - still)[use], axis=1).mean()),
            float(np.median(np.linalg.norm(difference - truth, axis=1))),
            float(np.linalg.norm(truth, axis=1).mean()),
            100.0 * float(valid.mean()),
        )

    def _velocities(self, flow: Flow) -> tuple[Array, BoolArray, Array]:
        """Velocities in the sheet, shape (n, 2), which passed, shape (n,), and their places in W, shape (n, 3)."""
        pair = photograph_pair(flow, self.sheet, CAMERA, TracerSettings(), self.rng)
        found = displacements([(pair.first, pair.second)])[0]
        columns, rows = np.meshgrid(found.columns_px, found.rows_px)
        local = np.stack(
            [
                (columns - 0.5 * CAMERA.width_px) * CAMERA.m_per_px,
                (rows - 0.5 * CAMERA.height_px) * CAMERA.m_per_px,
                np.zeros_like(columns),
            ],
            axis=-1,
        ).reshape(-1, 3)
        m_s = CAMERA.m_per_px / CAMERA.dt_s
        velocity = np.stack([found.right_px, found.down_px], axis=-1).reshape(-1, 2) * m_s
        return velocity, found.valid.reshape(-1), self.sheet.to_world(local)

    def _near(self, places_W_m: Array) -> BoolArray:
        """Which places lie in the water within `NEAR_M` of the target and above the bed."""
        corners = self.target.mesh.triangles_m
        middles = corners.mean(axis=1)
        distance, face = KDTree(middles).query(places_W_m)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[face]
        outside = np.einsum("ij,ij->i", places_W_m - middles[face], normal) > 0.0
        above = places_W_m[:, 2] < self.target.bed_z_m - CLEAR_M
        return np.asarray(outside & above & (distance < NEAR_M) & (distance > CLEAR_M))
