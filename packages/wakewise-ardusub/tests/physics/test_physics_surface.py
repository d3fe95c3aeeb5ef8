"""Where the water ends for a vehicle behind a firmware, and how it comes under it."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.physics import FreeWater
from wakewise_ardusub.physics.surface import LOWERED_M_S, LoweringBody, WaterSurface

HEAVY = load_vehicle("bluerov2-heavy")
SURFACE = WaterSurface.of(HEAVY)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
TILTED = quat_from_euler(0.4, -0.3, 2.0)


def at(depth_m: float, q: np.ndarray = LEVEL) -> Pose:
    return Pose(np.array([0.3, -0.2, depth_m]), q)


@pytest.mark.parametrize("q", [LEVEL, TILTED])
def test_what_is_above_the_water_has_its_weight(q: np.ndarray) -> None:
    """Deep down nothing is lost, half out half the buoyancy, wholly out all of it; the force is down in the world."""
    for depth_m, share in ((5.0, 0.0), (0.0, 0.5), (-5.0, 1.0)):
        wrench = SURFACE.wrench_B(at(depth_m, q))
        assert at(depth_m, q).R @ wrench[:3] == pytest.approx([0.0, 0.0, share * SURFACE.buoyancy_N])
        assert wrench[3:] == pytest.approx(np.cross(HEAVY.p_BB_m, wrench[:3]))


def test_a_disk_in_the_air_gives_no_thrust() -> None:
    """Each by its own depth: tilted, those on the high side lose theirs first."""
    full = np.full(len(HEAVY.thrusters), 10.0)
    assert SURFACE.thrusts(full, at(2.0)) == pytest.approx(full)
    assert SURFACE.thrusts(full, at(-2.0)) == pytest.approx(0.0 * full)
    rolled = at(0.05, quat_from_euler(0.6, 0.0, 0.0))
    given = SURFACE.thrusts(full, rolled)
    depths = rolled.apply(HEAVY.thruster_positions_B_m)[:, 2]
    assert given[np.argmin(depths)] < given[np.argmax(depths)] == 10.0


def test_it_is_held_let_down_and_then_free() -> None:
    """At rest at 0 while thrusts run, down to the start without a step in speed, then the body's own; time goes on."""
    start = BodyState(X_WB=Pose(np.array([0.5, -0.4, 1.5]), TILTED))
    body = LoweringBody(FreeWater(HEAVY, start), start, 3.0)
    push, dt_s = np.full(8, 20.0), 0.01
    assert body.stage == "held at the surface for 3 s more"
    motions = [body.step(push, dt_s) for _ in range(299)]
    assert all(m.p_WB_m == pytest.approx([0.5, -0.4, 0.0]) for m in motions)
    motions += [body.step(push, dt_s) for _ in range(3)]
    assert body.stage == "let down, 10 s more"
    while body.stage:
        motions.append(body.step(push, dt_s))
    free = motions.pop()
    assert free.time_s == pytest.approx(13.0, abs=0.02)
    depths = np.array([m.p_WB_m[2] for m in motions])
    speeds = np.array([m.v_W_m_s[2] for m in motions])
    assert depths[-1] == pytest.approx(1.5, abs=1e-3)
    assert np.diff(depths) / dt_s == pytest.approx(speeds[1:], abs=2e-3)
    assert 0.0 <= speeds.min() <= speeds.max() <= LOWERED_M_S + 1e-9
    felt = np.array([Pose(m.p_WB_m, m.q_WB).R @ m.force_B_m_s2 for m in motions])
    assert felt[:, 2] == pytest.approx(np.gradient(speeds, dt_s) - GRAVITY_M_S2, abs=2e-3)
    for _ in range(100):
        motion = body.step(push, dt_s)
    assert np.linalg.norm(motion.p_WB_m - [0.5, -0.4, 1.5]) > 0.01
