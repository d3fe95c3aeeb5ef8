"""Whether the autopilot knows how deep it is: ArduSub's calibration at the start, and who says that it is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.transports import MavlinkCodec
from wakewise_ardusub.physics import FreeWater, SimulatedBody
from wakewise_ardusub.physics.surface import LoweringBody
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl_plant import APART_M, DepthMonitor

HEAVY = load_vehicle("bluerov2-heavy")
START = BodyState(X_WB=Pose(np.array([0.0, 0.0, 1.4]), np.array([1.0, 0.0, 0.0, 0.0])))
UP, DOWN = (np.linalg.pinv(HEAVY.allocation_matrix) @ [0.0, 0.0, force_N, 0.0, 0.0, 0.0] for force_N in (-30.0, 30.0))


class Wire:
    """A `Carrier` of what a stand-in says."""

    def __init__(self, made: SimulatedAutopilot) -> None:
        self._made = made

    def receive(self, timeout_s: float) -> bytes:
        return b"".join(self._made.take_out())

    def send(self, data: bytes) -> None:
        raise AssertionError("a watch only listens")


def flown(body: SimulatedBody, hold_s: float) -> tuple[DepthMonitor, list[float], list[float], list[str]]:
    """Rest, 5 s down, up for 12 s, 2 s down again: the watch, true depths, those of the autopilot, the words."""
    made = SimulatedAutopilot(loop_hz=50.0, zero_depth_m=None)
    watch = DepthMonitor(MavlinkCodec(Wire(made), 1))
    truths, told, words = [], [], []
    for push, seconds in ((np.zeros(8), hold_s), (DOWN, 5.0), (UP, 12.0), (DOWN, 2.0)):
        for k in range(round(50 * seconds)):
            motion = body.step(push, 0.02)
            made.step(motion)
            if k % 50 == 49 and not getattr(body, "stage", ""):
                watch.look(float(motion.p_WB_m[2]))
                truths.append(float(motion.p_WB_m[2]))
                told.append(made.depth_m)
                words.append(watch.words)
    return watch, truths, told, words


def test_started_under_water_it_knows_no_depth_and_that_is_said() -> None:
    """It reads 0 where it began, and again wherever it is shallower; each look at it counts, and the line says so."""
    watch, truths, told, words = flown(FreeWater(HEAVY, START), 1.0)
    assert max(truths) > 1.6
    assert min(truths) < 0.2
    assert told[0] == pytest.approx(0.0, abs=0.1)
    assert min(told) >= 0.0
    assert watch.most_m > 1.0
    assert watch.apart > 0.6 * watch.looks
    assert sum("WRONG" in each for each in words) == watch.apart
    assert words[-1].endswith(f"({watch.apart} of {watch.looks} looks over 0.3 m)")
    assert watch.facts()["depth_apart"] == watch.apart


def test_let_down_from_the_surface_it_knows_its_depth() -> None:
    """Down, up to the surface and down again it is right to a message's age; the surface gives no new zero."""
    watch, truths, told, words = flown(LoweringBody(FreeWater(HEAVY, START), START, 2.0), 12.5)
    assert max(truths) > 1.6
    assert min(truths) < 0.2
    assert told == pytest.approx(truths, abs=1e-6)
    assert watch.most_m < 0.1 < APART_M
    assert watch.apart == 0
    assert watch.looks == len(truths)
    assert not any("WRONG" in each or "looks" in each for each in words)


def test_an_autopilot_that_says_nothing_is_not_compared() -> None:
    """No figure is made of what was never heard, nor of a truth that there is not yet."""
    watch = DepthMonitor(MavlinkCodec(Wire(SimulatedAutopilot(loop_hz=50.0)), 1))
    watch.look(1.0)
    watch.look(None)
    assert (watch.looks, watch.words) == (0, "autopilot's depth not heard")
    assert math.isnan(watch.off_m)
    assert watch.facts()["depth_apart_most_m"] is None
