"""The water of a flight once more: the logged thrusts and true poses drive the tank's own water, and tracers show it.

Same laws, same settings and same seed as in the trial, in steps of `STEP_S`, so what is seen is what the vehicle
stirred up; single eddies of the turbulence need not be the same. Tracers are let go where a thruster's jet begins, as
many as the square root of its thrust asks for, and go with the water; they weigh nothing and change nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.geometry import matrix_from_quat
from wakewise.core.interfaces import no_progress
from wakewise.operation import Scenario
from wakewise.operation.worlds.makers import tank_world
from wakewise.simulation.water import Water

STEP_S = 0.04
LIFE_S = 5.0
TRACERS_PER_S = 80.0
"""Tracers a second of a thruster that pushes with 1 N."""
TRAIL = 7
"""Places kept of every tracer, newest first."""
TRAIL_EVERY = 2
"""Steps between two places of a trail."""
REST_M_S = 0.004
"""Slower tracers are let go: they show nothing any more."""
_VERSION = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracers:
    """Tracers at one instant: trail_W_m (n, TRAIL, 3) newest first, speed_m_s (n,) over the still water, age_s (n,)."""

    trail_W_m: Array
    speed_m_s: Array
    age_s: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedMotion:
    """True motion of a vehicle as recorded: times (k,), p_W_m (k, 3), q_WB (k, 4), thrusts_N (k, n)."""

    time_s: Array
    p_W_m: Array
    q_WB: Array
    thrusts_N: Array

    @classmethod
    def of(cls, steps: pl.DataFrame) -> RecordedMotion:
        """Take the motion from steps.parquet.

        Raises InputError if the true motion was not recorded.
        """
        thrusts = [name for name in steps.columns if name.startswith("thrust_") and name.endswith("_N")]
        place = [f"true_{a}_m" for a in "xyz"]
        turn = [f"true_q{a}" for a in "wxyz"]
        missing = [name for name in ("time_s", *place, *turn) if name not in steps.columns]
        if missing or not thrusts:
            raise InputError(f"steps.parquet: no {', '.join(missing) or 'thrust_1_N'}, a film needs the true motion")
        return cls(
            time_s=steps["time_s"].to_numpy().astype(np.float64),
            p_W_m=steps.select(place).to_numpy().astype(np.float64),
            q_WB=steps.select(turn).to_numpy().astype(np.float64),
            thrusts_N=steps.select(thrusts).to_numpy().astype(np.float64),
        )

    def row(self, time_s: float) -> int:
        """Last row not later than a time."""
        return int(np.clip(np.searchsorted(self.time_s, time_s + 1e-9, side="right") - 1, 0, len(self.time_s) - 1))


def wash_of(
    scenario: Scenario,
    steps_path: Path,
    times_s: Array,
    kept: Path,
    progress: Callable[..., None] = no_progress,
) -> list[Tracers]:
    """Tracers at rising times, shape (k,); the answer is kept in the file `kept` and taken from there next time.

    Raises InputError if the record lacks the true motion.
    """
    digest = hashlib.sha256(steps_path.read_bytes())
    digest.update(repr((_VERSION, STEP_S, LIFE_S, TRACERS_PER_S, TRAIL, TRAIL_EVERY)).encode())
    digest.update(np.asarray(times_s, np.float64).tobytes())
    key = digest.hexdigest()
    found = _read(kept, key)
    if found is not None:
        return found
    motion = RecordedMotion.of(pl.read_parquet(steps_path))
    tank = tank_world(scenario.parts()).tank()
    mounts = tank.vehicle.thruster_positions_B_m, tank.vehicle.thruster_axes_B
    disks = np.sqrt(tank.vehicle.disk_areas_m2 / np.pi)
    out = replay(tank.water, motion, mounts, disks, np.asarray(times_s, np.float64), progress)
    _write(kept, key, out)
    return out


def replay(
    water: Water,
    motion: RecordedMotion,
    mounts_B: tuple[Array, Array],
    disk_radii_m: Array,
    times_s: Array,
    progress: Callable[..., None] = no_progress,
) -> list[Tracers]:
    """Drive `water` from its start with a recorded motion and give the tracers at rising times.

    `mounts_B` are places and force axes of the thrusters in the body frame, shape (n, 3) each.
    """
    cloud = _Cloud(len(disk_radii_m))
    rng = np.random.default_rng(20)
    out: list[Tracers] = []
    origins_before = None
    time_s, step = float(motion.time_s[0]), 0
    end_s = float(times_s[-1]) if len(times_s) else time_s
    while True:
        while len(out) < len(times_s) and times_s[len(out)] <= time_s + 0.5 * STEP_S:
            out.append(cloud.now())
        if len(out) >= len(times_s):
            return out
        low, high = motion.row(time_s), motion.row(time_s + STEP_S)
        R = matrix_from_quat(motion.q_WB[high])
        origins = mounts_B[0] @ R.T + motion.p_W_m[high]
        axes = mounts_B[1] @ R.T
        thrusts = motion.thrusts_N[low : max(high, low + 1)]
        impulses = np.stack([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)], axis=2).mean(axis=0) * STEP_S
        water.step(STEP_S, origins if origins_before is None else origins_before, origins, axes, impulses)
        origins_before = origins
        cloud.move(water, step)
        cloud.emit(origins, axes, thrusts.mean(axis=0), disk_radii_m, rng)
        time_s += STEP_S
        step += 1
        if step % 10 == 0:
            progress(time_s, end_s, "replaying the water")


class _Cloud:
    """Tracers in the water."""

    def __init__(self, thrusters: int) -> None:
        self._trail = np.zeros((0, TRAIL, 3))
        self._speed = np.zeros(0)
        self._age = np.zeros(0)
        self._due = np.zeros(thrusters)

    def now(self) -> Tracers:
        return Tracers(trail_W_m=self._trail.copy(), speed_m_s=self._speed.copy(), age_s=self._age.copy())

    def emit(self, origins: Array, axes: Array, thrusts_N: Array, radii_m: Array, rng: np.random.Generator) -> None:
        """Let new ones go on the disk from which each jet leaves."""
        self._due += TRACERS_PER_S * STEP_S * np.sqrt(np.abs(thrusts_N))
        counts = np.floor(self._due).astype(int)
        self._due -= counts
        source = np.repeat(np.arange(len(counts)), counts)
        if not len(source):
            return
        jet = -np.sign(thrusts_N)[source, None] * axes[source]
        off = rng.normal(size=(len(source), 3))
        off -= np.sum(off * jet, axis=1, keepdims=True) * jet
        off /= np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-12)
        reach = (radii_m[source] * np.sqrt(rng.random(len(source))))[:, None]
        ahead = (radii_m[source] * rng.random(len(source)))[:, None]
        born = origins[source] + reach * off + ahead * jet
        self._trail = np.concatenate([self._trail, np.repeat(born[:, None], TRAIL, axis=1)])
        self._speed = np.concatenate([self._speed, np.zeros(len(born))])
        self._age = np.concatenate([self._age, np.zeros(len(born))])

    def move(self, water: Water, step: int) -> None:
        """Carry all by one step; forget the old, the resting and those under the bed."""
        if not len(self._age):
            return
        velocity = water.velocity(self._trail[:, 0])
        if step % TRAIL_EVERY == 0:
            self._trail[:, 1:] = self._trail[:, :-1].copy()
        self._trail[:, 0] += velocity * STEP_S
        self._speed = np.linalg.norm(velocity - water.ambient_velocity(self._trail[:, 0]), axis=1)
        self._age = self._age + STEP_S
        keep = (self._age < LIFE_S) & ((self._speed > REST_M_S) | (self._age < 0.5))
        keep &= (self._trail[:, 0, 2] < water.bed_z_m) & (self._trail[:, 0, 2] > 0.0)
        self._trail, self._speed, self._age = self._trail[keep], self._speed[keep], self._age[keep]


def _write(path: Path, key: str, tracers: list[Tracers]) -> None:
    counts = np.array([len(t.age_s) for t in tracers], dtype=np.int64)
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            key=np.array(key),
            counts=counts,
            trail=np.concatenate([t.trail_W_m for t in tracers]).astype(np.float32),
            speed=np.concatenate([t.speed_m_s for t in tracers]).astype(np.float32),
            age=np.concatenate([t.age_s for t in tracers]).astype(np.float32),
        )


def _read(path: Path, key: str) -> list[Tracers] | None:
    if not path.is_file():
        return None
    with np.load(path) as data:
        if str(data["key"]) != key:
            return None
        edges = np.cumsum(data["counts"])[:-1]
        parts = [np.split(data[name].astype(np.float64), edges) for name in ("trail", "speed", "age")]
    return [Tracers(trail_W_m=t, speed_m_s=s, age_s=a) for t, s, a in zip(*parts, strict=True)]
