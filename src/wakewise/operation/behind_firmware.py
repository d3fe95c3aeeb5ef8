"""A scenario's vehicle in its water behind an autopilot's firmware: any vehicle and any world that there is a truth of.

The firmware is answered with what truly is, not with what sensors say: its own sensor models are in it. Position is the
tank's own, with its surface at a depth of 0. Neither mission nor controller of the scenario has a part in it, but for
where the vehicle starts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.interfaces import BodyState, Plant, Witness
from wakewise.links.physics.datagrams import Motion
from wakewise.physics import GRAVITY_M_S2
from wakewise.warming import warm

if TYPE_CHECKING:
    from collections.abc import Callable

    from wakewise.operation.parts import Parts

_GRAVITY_W_M_S2 = np.array([0.0, 0.0, GRAVITY_M_S2])


class FlownBody:
    """A plant with a witness, as `wakewise.links.physics.Body`.

    The specific force is the mean over the step: what the velocity in the world gained, less gravity, in B.
    """

    def __init__(self, plant: Plant, witness: Witness) -> None:
        self._plant, self._witness = plant, witness
        self._time_s = 0.0
        self._v_W_m_s = _velocity_W(witness.observe().state)

    def step(self, thrusts_N: Array, dt_s: float) -> Motion:
        """Hold commanded thrusts, shape (n,), for `dt_s`."""
        self._plant.step(thrusts_N, dt_s)
        self._time_s += dt_s
        state = self._witness.observe().state
        R_WB, before = state.X_WB.R, self._v_W_m_s
        self._v_W_m_s = _velocity_W(state)
        return Motion(
            time_s=self._time_s,
            omega_B_rad_s=state.nu_B[3:],
            force_B_m_s2=((self._v_W_m_s - before) / dt_s - _GRAVITY_W_M_S2) @ R_WB,
            p_WB_m=state.X_WB.p_m,
            q_WB=state.X_WB.q,
            v_W_m_s=self._v_W_m_s,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class BehindFirmware:
    """The world of a scenario's parts, made ready to be driven by a firmware; `begin` is what `Physics` takes."""

    parts: Parts

    def begin(self) -> FlownBody:
        """The vehicle at its start, a fresh one at each call.

        Raises
        ------
        InputError
            If there is no truth of the world that could be told, or the vehicle does not fit into it.
        """
        plant, witness = self.parts.world.begin()
        if witness is None:
            raise InputError(f"--world {self.parts.scenario.world}: nobody knows the truth of it, a firmware needs it")
        return FlownBody(plant, witness)

    def ready(self, progress: Callable[..., None]) -> FlownBody:
        """Compile what a flight in it needs, move it once, and give a vehicle at its start."""
        warm(("fly",), progress)
        tried = self.begin()
        tried.step(np.zeros(len(self.parts.vehicle.thrusters)), 0.0025)
        return self.begin()


def _velocity_W(state: BodyState) -> Array:
    velocity: Array = state.X_WB.R @ state.nu_B[:3]
    return velocity
