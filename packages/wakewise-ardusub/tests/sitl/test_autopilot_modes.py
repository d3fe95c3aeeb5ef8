"""Modes of the stand-in: what each holds."""

import math

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.core.geometry import euler_from_quat
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD, MANUAL, STABILIZE
from wakewise_ardusub.sitl.inprocess_session import InProcessSession

HEAVY = load_vehicle("bluerov2-heavy")


def _flown(mode: int, seconds: float, **more: object) -> InProcessSession:
    flight = InProcessSession(HEAVY, **more).run(0.1)
    flight.set_mode(mode)
    flight.arm(True)
    return flight.run(seconds)


def test_manual_holds_nothing() -> None:
    """Sticks let go, no motor runs, and a buoyant vehicle drifts."""
    flight = _flown(MANUAL, 5.0)
    assert not flight.moments[-1].thrusting


def test_stabilize_holds_attitude_and_heading() -> None:
    """After a turn the heading stays within 3 degrees at half speed ahead, roll within 3 and pitch within 8."""
    flight = _flown(STABILIZE, 2.0, sticks=(0, 0, 500, 300))
    turned = euler_from_quat(flight.autopilot.motion.q_WB)[2]
    assert abs(turned) > math.radians(10.0)
    flight.sticks = (400, 0, 500, 0)
    flight.run(3.0)
    heading = euler_from_quat(flight.autopilot.motion.q_WB)[2]
    flight.run(5.0)
    after = euler_from_quat(flight.autopilot.motion.q_WB)
    assert abs(after[0]) < math.radians(3.0)
    assert abs(after[1]) < math.radians(8.0)
    assert abs(math.remainder(after[2] - heading, 2 * math.pi)) < math.radians(3.0)


def test_alt_hold_holds_the_depth_that_stabilize_does_not() -> None:
    """Within 5 cm over 20 s, where the vehicle's buoyancy moves it by more."""
    depths = {}
    for mode in (STABILIZE, ALT_HOLD):
        flight = _flown(mode, 20.0)
        depths[mode] = abs(float(flight.autopilot.motion.p_WB_m[2]) - 2.0)
    assert depths[ALT_HOLD] < 0.05 < depths[STABILIZE]
