"""One of each part that Wakewise takes from outside, as a package of somebody else's would hold them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import wakewise as ww
from wakewise.allocation import Layout, min_norm_allocation
from wakewise.control import ControlTask, Pid, PidState, make_pid, vehicle_layout
from wakewise.core.arrays import Array
from wakewise.operation.worlds.makers import tank_world
from wakewise.robot.vehicles import VehicleDraft, load_draft
from wakewise.scene.targets import Mesh
from wakewise.simulation.tank import TankWorld


@dataclass(frozen=True)
class SternOnly:
    """Controller: the PID of `dp`; the two bow thrusters never blow forward."""

    tracker: Pid
    layout: Layout
    name: str = "stern-only"

    def init(self) -> PidState:
        return self.tracker.init()

    def step(self, state: PidState, dt_s: float, estimate: ww.BodyState, goal: ww.Goal) -> tuple[PidState, ww.Command]:
        state, wrench_B = self.tracker.wrench(state, dt_s, estimate, goal, saturated=False)
        return state, ww.Command(thrusts_N=min_norm_allocation(self.layout, wrench_B).thrusts_N, wrench_B=wrench_B)


def stern_only(task: ControlTask) -> SternOnly:
    """Make the controller for what is to be controlled: vehicle, region, wake, settings, surroundings."""
    layout = vehicle_layout(task.vehicle)
    lower, upper = layout.lower_N.copy(), layout.upper_N.copy()
    bow = (task.vehicle.thruster_positions_B_m[:, 0] > 0) & (np.abs(task.vehicle.thruster_axes_B[:, 2]) < 0.5)
    # A jet leaves against the force: forward jets push astern.
    astern = task.vehicle.thruster_axes_B[:, 0] < 0
    upper[bow & astern], lower[bow & ~astern] = 0.0, 0.0
    return SternOnly(make_pid(task.vehicle, task.settings), replace(layout, lower_N=lower, upper_N=upper))


@dataclass(frozen=True)
class TopHat:
    """Wake model: a jet of even speed in a cone of 10 degrees, which keeps its momentum; no gradients."""

    name: str = "top-hat"

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        away = points_W_m[None] - origins_W_m[:, None]
        along = np.einsum("inx,ix->in", away, directions_W)
        across = np.linalg.norm(away - along[..., None] * directions_W[:, None], axis=2)
        radius = np.sqrt(area_m2 / np.pi)[:, None] + np.tan(np.radians(10.0)) * np.maximum(along, 0.0)
        speed = np.where((along > 0) & (across < radius), 1.0 / np.sqrt(998.0 * np.pi) / radius, 0.0)
        return np.asarray(speed[..., None] * directions_W[:, None])


def read_mass_file(path: Path) -> VehicleDraft:
    """Vehicle format `.mass`: one number, the mass in kg of an otherwise usual BlueROV2 Heavy."""
    return replace(load_draft("bluerov2-heavy"), name=path.stem, mass_kg=float(path.read_text()))


def pyramid(seed: int) -> Mesh:
    """Target: a square pyramid, 16 cm wide and high, in a z-up frame on its bed."""
    corners = 0.08 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 2.0]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]])
    return Mesh(corners, faces)


@dataclass(frozen=True)
class Hover:
    """Pilot: stay where the mission begins."""

    X_WB: ww.Pose

    def goal(self, time_s: float, estimate: ww.BodyState) -> ww.Goal:
        return ww.Goal(X_WB=self.X_WB)


def hover(parts: ww.Parts) -> Hover:
    """Make the pilot from the parts of the flight."""
    return Hover(parts.start.X_WB)


def quiet_tank(parts: ww.Parts) -> TankWorld:
    """World: the tank without any current."""
    still = parts.scenario.replace(**{"tank.current.velocity_m_s": [0, 0, 0]})
    return replace(tank_world(parts), settings=still.tank, name="quiet-tank")


@dataclass(frozen=True)
class Tide:
    """Current: to and fro along north."""

    uniform = True

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        return np.tile([0.02 * np.cos(2 * np.pi * time_s / 60.0), 0.0, 0.0], (len(points_W_m), 1))
