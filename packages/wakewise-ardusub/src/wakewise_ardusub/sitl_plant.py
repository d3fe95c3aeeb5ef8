"""Any scenario's vehicle and world as physics behind an autopilot's firmware.

The firmware gets the true motion, because its own sensor models add the errors. Positions are the tank's, with the
surface at a depth of 0, which the vehicle cannot leave (`WaterSurface`). Mission and controller of the scenario have no
part in it, except for the start pose.

`DepthMonitor` compares the autopilot's depth (VFR_HUD) with the true one.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, Plant, TruthProvider
from wakewise.core.jit.precompile import compile_kernels
from wakewise_ardusub.link.message_state import LinkState, MavlinkMessage, update_link_state
from wakewise_ardusub.link.protocol import DEFAULT_SYSTEM
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.physics.physics import SimulatedBody
from wakewise_ardusub.physics.surface import LoweringBody, WaterSurface

if TYPE_CHECKING:
    from collections.abc import Callable

    from wakewise.operation.parts import Parts


_GRAVITY_W_M_S2 = np.array([0.0, 0.0, GRAVITY_M_S2])


class _PushedPlant(Plant, Protocol):
    """A plant that takes a wrench from outside, as that of the surface."""

    def push(self, wrench_B: Array) -> None:
        """Apply a wrench, shape (6,), in B, until the next call."""
        ...


class PlantBody:
    """A plant with a truth provider, as `wakewise_ardusub.physics.SimulatedBody`.

    The specific force is the mean over the step: what the velocity in the world gained, less gravity, in B.

    Parameters
    ----------
    plant : Plant
    truth_provider : TruthProvider
    surface : Surface, optional
        Where the water ends; the plant must have a method `push`.
    """

    def __init__(self, plant: Plant, truth_provider: TruthProvider, surface: WaterSurface | None = None) -> None:
        self._plant, self._truth_provider, self._surface = plant, truth_provider, surface
        self._time_s = 0.0
        self.state = truth_provider.observe().state
        """Where it is and how it moves."""
        self._v_W_m_s = _velocity_W(self.state)
        self._push: Callable[[Array], None] | None = None if surface is None else cast("_PushedPlant", plant).push

    def step(self, thrusts_N: Array, dt_s: float) -> PhysicsState:
        """Hold commanded thrusts, shape (n,), for `dt_s`."""
        if self._surface is not None and self._push is not None:
            self._push(self._surface.wrench_B(self.state.X_WB))
            thrusts_N = self._surface.thrusts(thrusts_N, self.state.X_WB)
        self._plant.step(thrusts_N, dt_s)
        self._time_s += dt_s
        self.state = state = self._truth_provider.observe().state
        R_WB, before = state.X_WB.R, self._v_W_m_s
        self._v_W_m_s = _velocity_W(state)
        return PhysicsState(
            time_s=self._time_s,
            omega_B_rad_s=state.nu_B[3:],
            force_B_m_s2=((self._v_W_m_s - before) / dt_s - _GRAVITY_W_M_S2) @ R_WB,
            p_WB_m=state.X_WB.p_m,
            q_WB=state.X_WB.q,
            v_W_m_s=self._v_W_m_s,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SitlPlant:
    """The world of a scenario's parts, made ready to be driven by a firmware; `begin` is what `Physics` takes.

    Parameters
    ----------
    parts : Parts
    held_s : float
        How long the vehicle is held at the surface first, see `LoweringBody`; 0 begins at its start.
    """

    parts: Parts
    held_s: float = 0.0

    def begin(self) -> SimulatedBody:
        """The vehicle at its start, a fresh one at each call.

        Raises
        ------
        InputError
            If there is no truth of the world that could be told, or the vehicle does not fit into it.
        """
        plant, truth_provider = self.parts.world.begin()
        if truth_provider is None:
            raise InputError(f"--world {self.parts.scenario.world}: nobody knows the truth of it, a firmware needs it")
        surface = WaterSurface.of(self.parts.vehicle) if self.has_surface(plant) else None
        body = PlantBody(plant, truth_provider, surface)
        return LoweringBody(body, body.state, self.held_s) if self.held_s > 0.0 else body

    @staticmethod
    def has_surface(plant: Plant) -> bool:
        """Whether a plant can be given a surface: all of this package can, those of others may lack `push`."""
        return hasattr(plant, "push")

    def ready(self, progress: Callable[..., None]) -> str:
        """Compile what a flight in it needs and move it once; what people should know of it, in words."""
        compile_kernels(("fly",), progress)
        plant, truth_provider = self.parts.world.begin()
        if truth_provider is not None:
            PlantBody(plant, truth_provider).step(np.zeros(len(self.parts.vehicle.thrusters)), 0.0025)
        self.begin()
        return "" if self.has_surface(plant) else "the world has no method push: the vehicle can rise out of its water"


def _velocity_W(state: BodyState) -> Array:
    velocity: Array = state.X_WB.R @ state.nu_B[:3]
    return velocity


APART_M = 0.3
"""A difference that is told: more than the simulated sensor's noise and than a fast dive between two messages."""
FRESH_S = 1.0
_MOST = 1000


class MessageSource(Protocol):
    """Where messages come from."""

    def receive(self, timeout_s: float) -> tuple[list[MavlinkMessage], int]:
        """Messages that came, and how many stretches of bytes were none."""
        ...


class DepthMonitor:
    """Compares now and then what the autopilot last said with the truth.

    Attributes
    ----------
    looks, apart : int
        How often both were known, and how often they were more than `APART_M` apart.
    off_m, most_m : float
        What the autopilot says less the truth, as last seen, and the largest without its sign; NaN before.
    """

    def __init__(self, receiving: MessageSource, system: int = DEFAULT_SYSTEM) -> None:
        self._receiving, self._known = receiving, LinkState(system=system)
        self.looks = self.apart = 0
        self.off_m = self.most_m = math.nan

    def look(self, depth_m: float | None) -> None:
        """Take what came, and compare the last of it with the depth that is true now."""
        for _ in range(_MOST):
            said, bad = self._receiving.receive(0.0)
            if not said and not bad:
                break
            for message in said:
                self._known = update_link_state(self._known, message, time.monotonic())
        fresh = time.monotonic() - self._known.depth_s < FRESH_S
        if depth_m is None or not fresh:
            self.off_m = math.nan
            return
        self.off_m = self._known.depth_m - depth_m
        self.looks += 1
        self.apart += abs(self.off_m) > APART_M
        self.most_m = max(abs(self.off_m), self.most_m) if self.looks > 1 else abs(self.off_m)

    @property
    def words(self) -> str:
        """For the status line: how far it is off, or that nothing is heard."""
        if not math.isfinite(self.off_m):
            return "autopilot's depth not heard"
        told = f"autopilot's depth {self.off_m:+.2f} m from the truth"
        told += " WRONG" if abs(self.off_m) > APART_M else ""
        return told + (f" ({self.apart} of {self.looks} looks over {APART_M:g} m)" if self.apart else "")

    def facts(self) -> dict[str, float | int | None]:
        """Figures as JSON has them."""
        most = self.most_m if math.isfinite(self.most_m) else None
        return {"depth_looks": self.looks, "depth_apart": self.apart, "depth_apart_most_m": most}
