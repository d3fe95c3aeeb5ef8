"""A flight beside the pilot, against the stand-in and the shipped script, in its own time."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.geometry import Pose
from wakewise.interfaces import BodyState
from wakewise.links.ardusub.journal import Journal, read_journal
from wakewise.links.ardusub.listening import attitude_of
from wakewise.links.autopilot.aboard import Aboard
from wakewise.links.autopilot.rehearsal import Rehearsal
from wakewise.operation.at_sea.join import SEA, at_sea
from wakewise.operation.at_sea.rehearsal import rehearse
from wakewise.operation.at_sea.target import ball, ball_points
from wakewise.operation.by_hand.shutter import Shutter
from wakewise.operation.flying import loop_of, recorder_of
from wakewise.operation.scenario import Scenario
from wakewise.vehicles import load_vehicle

MISSION = {
    "mission.elevations_deg": [15.0],
    "mission.views": [4],
    "mission.speed_m_s": 0.25,
    "mission.acceleration_m_s2": 0.2,
    "mission.approach_m": 0.1,
    "mission.settle_s": 0.5,
    "mission.standoff_m": 0.7,
}


def aboard(journal: Journal | None = None) -> Aboard:
    """A warden beside the stand-in whose thrusts are the flight's alone."""
    made = Aboard(Rehearsal(load_vehicle("bluerov2-heavy"), loop_hz=50.0), journal=journal)
    made.decides = False
    return made


class Clock:
    """A flight that begins now."""

    def __init__(self, began_s: float) -> None:
        self.began_s = began_s

    def due_s(self, time_s: float) -> float:
        """When a time of the flight has come."""
        return self.began_s + time_s


def afloat(companion: Aboard, method: str = "dp"):
    """The parts of a flight of the vehicle of a companion, and how often it took a photograph."""
    known = companion.warden.known
    start = BodyState(X_WB=Pose(known.place_W_m, attitude_of(known)))
    middle = start.X_WB.apply(np.array([0.9, 0.0, 0.0]))
    scenario = Scenario(vehicle="bluerov2-heavy", method=method).replace(**SEA, **MISSION)
    photographs: list[float] = []
    sea = at_sea(
        scenario,
        companion.warden,
        start=start,
        target=ball(middle, 0.2),
        region=ball_points(middle, 0.2),
        clock=lambda: Clock(companion.clock()),
        wait=companion.flight.run,
        flown_N=companion.flown_N,
        photographed=lambda: photographs.append(companion.clock()),
    )
    return sea, photographs


def test_arm_engage_fly_an_orbit_capture_release_disarm(tmp_path):
    """The whole of a session: an orbit round the target with its photographs, on thrusts that the script puts out.

    The pilot has the vehicle before and after; no output is driven while it is disarmed or the pilot flies.
    """
    journal = Journal(tmp_path / "journal.jsonl")
    companion = aboard(journal)
    companion.flight.run(1.0)
    sea, photographs = afloat(companion)
    assert rehearse(sea) < 5.0
    shutter = Shutter(sea.parts)
    steps, goals = [], []

    def watch(step):
        record(step)
        sea.figures(step)
        steps.append(step)
        goals.append(float(np.linalg.norm(step.goal.X_WB.p_m - step.estimate.X_WB.p_m)))

    plant, witness = sea.parts.world.begin()
    record = recorder_of(sea.parts, witness, shutter)
    fly = loop_of(sea.parts, plant, witness, watch)
    at = {"engaged": 0.0, "released": 0.0}

    def direct(time_s: float) -> None:
        """What the operator does, by the clock of the flight."""
        if companion.warden.entry is None and at["engaged"] == 0.0 and time_s > 2.5:
            assert companion.warden.press() == "engaged"
            at["engaged"] = companion.clock()
        elif at["engaged"] and companion.clock() > at["engaged"] + 1.0 and not photographs:
            sea.desk.set(mode="scan")
        if at["engaged"] and not at["released"] and len(photographs) == 4 and sea.desk.state.mode == "hold":
            companion.warden.press()
            at["released"] = companion.clock()

    companion.flight.arm(True)
    companion.flight.set("WKW_ENABLE", 1.0)
    over = iter(range(800))
    fly(duration_s=None, pace=direct, stop=lambda: next(over, 799) > 700 or bool(at["released"]))
    companion.flight.run(1.0)
    companion.flight.arm(False)
    companion.flight.run(1.0)
    companion.warden.end("the session is over")
    companion.flight.run(0.2)
    journal.close()

    assert len(photographs) == 4
    flown = [step for step in steps if step.command.thrusts_N.any()]
    away = np.array([step.estimate.X_WB.p_m - sea.parts.target.centre_W_m for step in flown])
    turned = np.ptp(np.unwrap(np.arctan2(away[:, 1], away[:, 0])))
    assert np.degrees(turned) > 265.0  # from the first of four views to the last
    apart = [far for step, far in zip(steps, goals, strict=True) if step.command.thrusts_N.any()]
    assert np.sqrt(np.mean(np.square(apart))) < 0.1
    driven = [moment.time_s + 1000.0 for moment in companion.flight.moments if moment.overridden]
    assert all(moment.armed for moment in companion.flight.moments if moment.overridden)
    assert min(driven) >= at["engaged"]
    assert max(driven) <= at["released"] + 0.3
    assert not companion.flight.moments[-1].thrusting
    values = {m.name for m in companion.flight.said if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert {"WKW_ENG", "WKW_VER"} <= values
    lines, spoiled = read_journal(tmp_path / "journal.jsonl")
    assert spoiled == 0
    states = [line["after"] for line in lines if line["event"] == "state"]
    assert states.count("engaged") == 1
    assert "refused" not in states


def test_sticks_never_break_the_surface_at_sea():
    """The water's surface lies as far above the vehicle as its depth says, wherever the autopilot's origin is."""
    companion = aboard()
    companion.flight.run(1.0)
    sea, _ = afloat(companion)
    around = sea.parts.surroundings
    known = companion.warden.known
    assert around.names == ("the water surface", "the target")
    assert around.planes[0][:3] == pytest.approx([0.0, 0.0, 1.0])
    assert around.planes[0][3] == pytest.approx(known.place_W_m[2] - known.depth_m, abs=1e-6)
    keep = sea.parts.pilot.inner.keep_off
    high = Pose(np.array([0.0, 0.0, around.planes[0][3] + 0.5 * 0.254 + 0.06]), np.array([1.0, 0.0, 0.0, 0.0]))
    velocity, blocks = keep.allowed(high, np.array([0.0, 0.0, -0.3]), np.zeros(3))
    assert blocks == "the water surface"
    assert velocity[2] > -0.1
