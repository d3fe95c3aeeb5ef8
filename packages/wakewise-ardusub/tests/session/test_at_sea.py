"""A flight beside the pilot, against the stand-in and the shipped script, in its own time."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from loopback_sea import until
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.operation.flying import loop_of, recorder_of
from wakewise.operation.loop import Step
from wakewise.operation.scenario import Scenario
from wakewise.operation.teleop.live import LiveFlight, PhotoTrigger
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.message_state import attitude_of
from wakewise_ardusub.link.protocol import ALT_HOLD, STABILIZE
from wakewise_ardusub.link.session_log import SessionLog, read_journal
from wakewise_ardusub.session.cameras import CAMERAS_FILE
from wakewise_ardusub.session.link_thread import LinkThread
from wakewise_ardusub.session.session import ProtectedRegion, VehicleSession, ball, ball_points
from wakewise_ardusub.session.vehicle_flight import SEA, join_vehicle
from wakewise_ardusub.session.warm_up import run_warm_up
from wakewise_ardusub.sitl.companion_harness import CompanionHarness
from wakewise_ardusub.sitl.inprocess_session import InProcessSession

MISSION = {
    "mission.elevations_deg": [15.0],
    "mission.views": [4],
    "mission.speed_m_s": 0.25,
    "mission.acceleration_m_s2": 0.2,
    "mission.approach_m": 0.1,
    "mission.settle_s": 0.5,
    "mission.standoff_m": 0.7,
}


def aboard(journal: SessionLog | None = None) -> CompanionHarness:
    """An output gate beside the stand-in whose thrusts are the flight's alone."""
    made = CompanionHarness(InProcessSession(load_vehicle("bluerov2-heavy"), loop_hz=50.0), journal=journal)
    made.decides = False
    return made


class Clock:
    """A flight that begins now."""

    def __init__(self, began_s: float) -> None:
        self.began_s = began_s

    def due_s(self, time_s: float) -> float:
        """When a time of the flight has come."""
        return self.began_s + time_s


def afloat(companion: CompanionHarness, method: str = "dp", photographed=None):
    """The parts of a flight of the vehicle of a companion, and when it took a photograph."""
    known = companion.gate.known
    start = BodyState(X_WB=Pose(known.place_W_m, attitude_of(known)))
    middle = start.X_WB.apply(np.array([0.9, 0.0, 0.0]))
    scenario = Scenario(vehicle="bluerov2-heavy", method=method).replace(**SEA, **MISSION)
    photographs: list[float] = []
    sea = join_vehicle(
        scenario,
        companion.gate,
        start=start,
        target=ball(middle, 0.2),
        region=ball_points(middle, 0.2),
        clock=lambda: Clock(companion.clock()),
        wait=companion.flight.run,
        flown_N=companion.flown_N,
        photographed=photographed or (lambda time_s, estimate: photographs.append(companion.clock())),
    )
    return sea, photographs


def test_arm_engage_fly_an_orbit_capture_release_disarm(tmp_path):
    """The whole of a session: an orbit round the target with its photographs, on thrusts that the script puts out.

    The pilot has the vehicle before and after; no output is driven while it is disarmed or the pilot flies.
    """
    journal = SessionLog(tmp_path / "journal.jsonl")
    companion = aboard(journal)
    companion.flight.run(1.0)
    sea, photographs = afloat(companion)
    assert run_warm_up(sea) < 5.0
    shutter = PhotoTrigger(sea.parts)
    steps, goals = [], []

    def watch(step):
        record(step)
        sea.figures(step)
        steps.append(step)
        goals.append(float(np.linalg.norm(step.goal.X_WB.p_m - step.estimate.X_WB.p_m)))

    plant, truth_provider = sea.parts.world.begin()
    record = recorder_of(sea.parts, truth_provider, shutter)
    fly = loop_of(sea.parts, plant, truth_provider, watch)
    at = {"engaged": 0.0, "released": 0.0}

    def direct(time_s: float) -> None:
        """What the operator does, by the clock of the flight."""
        if companion.gate.entry is None and at["engaged"] == 0.0 and time_s > 2.5:
            assert companion.gate.press() == "engaged"
            at["engaged"] = companion.clock()
        elif at["engaged"] and companion.clock() > at["engaged"] + 1.0 and not photographs:
            sea.operator.set(mode="scan")
        if at["engaged"] and not at["released"] and len(photographs) == 4 and sea.operator.state.mode == "hold":
            companion.gate.press()
            at["released"] = companion.clock()

    companion.flight.arm(True)
    companion.flight.set("WKW_ENABLE", 1.0)
    over = iter(range(800))
    fly(duration_s=None, pace=direct, stop=lambda: next(over, 799) > 700 or bool(at["released"]))
    companion.flight.run(1.0)
    companion.flight.arm(False)
    companion.flight.run(1.0)
    companion.gate.end("the session is over")
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
    lines, count_bad = read_journal(tmp_path / "journal.jsonl")
    assert count_bad == 0
    states = [line["after"] for line in lines if line["event"] == "state"]
    assert states.count("engaged") == 1
    assert "refused" not in states


def test_depth_is_held_while_engaged_in_alt_hold_and_after_hand_back():
    """Sticks let go: within 3 cm under the controller's thrusts, and 7 cm after the autopilot's ALT_HOLD has it back.

    Those are what ALT_HOLD, entered at rest, sags by itself before its sum holds a vehicle that is 1 N too heavy.

    Between them the sticks take the vehicle down by more than 20 cm; so ALT_HOLD holds another depth than it had.
    """
    companion = aboard()
    flight = companion.flight.run(1.0)
    flight.set_mode(ALT_HOLD)
    flight.arm(True)
    flight.set("WKW_ENABLE", 1.0)
    flight.run(3.0)
    sea, _ = afloat(companion)
    run_warm_up(sea)
    depths: dict[str, list[float]] = {"held": [], "after": []}
    at = {"engaged": 0.0, "released": 0.0}

    def direct(time_s: float) -> None:
        """Consent, down by the stick for 4 s, 6 s to come to rest and 5 s of holding, then hand back."""
        if not at["engaged"] and time_s > 1.5:
            assert companion.gate.press() == "engaged"
            at["engaged"] = time_s
        since_s = time_s - at["engaged"] if at["engaged"] else -1.0
        flight.sticks = (0, 0, 200, 0) if 0.5 < since_s < 4.5 else (0, 0, 500, 0)
        if since_s > 10.5:
            depths["held"].append(float(flight.autopilot.motion.p_WB_m[2]))
        if since_s > 15.5 and not at["released"]:
            assert "released" in companion.gate.press()
            at["released"] = time_s

    before_m = float(flight.autopilot.motion.p_WB_m[2])
    plant, truth_provider = sea.parts.world.begin()
    fly = loop_of(sea.parts, plant, truth_provider, sea.figures)
    fly(duration_s=None, pace=direct, stop=lambda: bool(at["released"]))
    assert flight.autopilot.mode in (ALT_HOLD, STABILIZE)
    for _ in range(100):
        flight.run(0.1)
        depths["after"].append(float(flight.autopilot.motion.p_WB_m[2]))
    assert flight.autopilot.mode == ALT_HOLD
    assert not flight.moments[-1].overridden
    held = np.array(depths["held"])
    assert held.mean() - before_m > 0.2
    assert np.ptp(held) < 0.03
    assert np.abs(np.array(depths["after"]) - held[-1]).max() < 0.07


class Deaf:
    """A connection on which nothing comes: the output gate is told by hand."""

    def receive(self, timeout_s):
        time.sleep(timeout_s)
        return [], 0


def session_of(folder, monkeypatch, **gate_options) -> VehicleSession:
    """A session that compiles nothing and hears nothing by itself."""
    monkeypatch.setattr("wakewise_ardusub.session.session.compile_kernels", lambda jobs, progress: None)
    return VehicleSession(
        scenario=Scenario(vehicle="bluerov2-heavy", method="dp").replace(**SEA),
        receiving=Deaf(),
        send=lambda name, fields: None,
        folder=folder,
        spare=ProtectedRegion(),
        session=1,
        gate_options=gate_options,
    )


def test_a_session_with_a_button_of_the_autopilots_ends_in_one_line(tmp_path, monkeypatch):
    """The stand-in's default table, whose button 4 disarms: no parts are made, and the fault names what is free."""
    companion = CompanionHarness(InProcessSession(load_vehicle("bluerov2-heavy"), loop_hz=50.0), buttons={"engage": 4})
    session = session_of(tmp_path / "sea", monkeypatch, buttons={"engage": 4, "scan": 0})
    companion.flight.run(3.0)
    session.gate.known = companion.gate.known
    session.start()
    session._thread.join(60.0)
    session.stop("over")
    assert isinstance(session.fault, InputError)
    assert str(session.fault) == "--buttons engage=4: BTN4_FUNCTION is 4 (disarm) on this autopilot; free is 15"
    assert not (tmp_path / "sea" / "steps.parquet").exists()


class Broken:
    """A connection that ends at the first look."""

    def receive(self, timeout_s):
        raise OSError("the adapter is gone")


def test_a_session_whose_link_breaks_is_over(tmp_path, monkeypatch):
    """Its owner sees that it runs no more, while the flight is still being prepared, and gets the link's fault."""
    session = session_of(tmp_path / "sea", monkeypatch)
    session._link = LinkThread(Broken(), session.gate)
    session.start()
    until(lambda: not session.running, "the end of the session", 10.0)
    assert session._thread.is_alive()
    session.stop("ended")
    assert str(session.fault) == "the adapter is gone"
    told = [line.get("reason") for line in read_journal(tmp_path / "sea" / "journal.jsonl")[0]]
    assert "the link broke (OSError: the adapter is gone)" in told


def test_what_fails_beside_the_flight_is_journalled_and_its_thread_ends(tmp_path, monkeypatch):
    """Coverage that cannot be reckoned: a line names the fault; a session that stops leaves no thread."""
    session = session_of(tmp_path / "sea", monkeypatch)
    companion = aboard(session.journal)
    companion.flight.run(1.0)
    session.sea, _ = afloat(companion)

    def no_patches(mesh, bed_z_m):
        raise ValueError("no surface")

    def told() -> list[str]:
        lines = read_journal(tmp_path / "sea" / "journal.jsonl")[0]
        return [line["amiss"] for line in lines if line["event"] == "figures"]

    monkeypatch.setattr("wakewise_ardusub.session.wash_figures.patches_of", no_patches)
    session.sea.figures.photographed(session.sea.parts.start.X_WB)
    until(told, "a line in the journal", 10.0)
    assert told() == ["ValueError: no surface"]
    session._link.start()
    session.stop("over")
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("coverage")]


def test_a_photograph_has_the_estimate_and_the_time_of_its_step(tmp_path, monkeypatch):
    """In cameras.csv, also in the first step of a flight."""
    companion = aboard()
    companion.flight.run(1.0)
    session = session_of(tmp_path / "sea", monkeypatch)
    session.sea, _ = afloat(companion, photographed=session._photographed)
    steps: list[Step] = []

    def watch(step, truth_provider):
        steps.append(step)
        if len(steps) in (3, 5):
            companion.gate._pressed.append("capture")
        if len(steps) == 8:
            session.live.stop()

    session.live = LiveFlight(session.sea.parts, folder=tmp_path / "sea", paced=False, watch=watch, checked=False)
    companion.gate._pressed.append("capture")
    session.live.run()
    table = np.genfromtxt(tmp_path / "sea" / CAMERAS_FILE, delimiter=",", names=True, dtype=None, encoding="utf-8")
    taken = [steps[k] for k in (0, 3, 5)]
    assert table["flight_s"] == pytest.approx([step.time_s for step in taken])
    for row, step in zip(table, taken, strict=True):
        X_WC = step.estimate.X_WB @ session.mount.X_BC()
        assert [row[name] for name in ("x_m", "y_m", "z_m")] == pytest.approx(X_WC.p_m, abs=2e-6)


def test_a_flight_begins_where_the_vehicle_is_when_its_parts_are_made(tmp_path, monkeypatch):
    """It moves while they are made: an estimator that began where it was would take the step for a load."""
    companion = aboard()
    companion.flight.run(1.0)
    session = session_of(tmp_path / "sea", monkeypatch)
    session.gate.known = companion.gate.known
    facts = companion.gate.facts()
    session.gate.facts = lambda: facts
    before = session._here()

    def moved(sea):
        assert sea.parts.start.X_WB.p_m == pytest.approx(before.X_WB.p_m)
        known = session.gate.known
        place_W_m = np.asarray(known.place_W_m) + np.array([0.2, 0.0, 0.3])
        session.gate.known = replace(known, place_W_m=place_W_m)
        return 0.0

    monkeypatch.setattr("wakewise_ardusub.session.session.run_warm_up", moved)
    sea = session._prepared()
    assert sea.parts.start.X_WB.p_m == pytest.approx(before.X_WB.p_m + np.array([0.2, 0.0, 0.3]))


def test_a_session_waits_for_a_hull_that_is_still_afloat(tmp_path, monkeypatch):
    """Before a dive the vehicle floats on its tether: the session says how much of it is above, and goes on waiting."""
    companion = aboard()
    companion.flight.run(1.0)
    session = session_of(tmp_path / "sea", monkeypatch)
    session.gate.known = replace(companion.gate.known, depth_m=0.0)
    facts = replace(companion.gate.facts(), depth_m=0.0)
    said = []

    def look():
        said.append(session.preparing)
        if len(said) == 3:
            session._over.set()
        return facts

    session.gate.facts = look
    assert session._prepared() is None
    assert said[-1] == "waits until the hull is under water, 0.13 m of it are above"


def test_sticks_never_break_the_surface_at_sea():
    """The water's surface lies as far above the vehicle as its depth says, wherever the autopilot's origin is."""
    companion = aboard()
    companion.flight.run(1.0)
    sea, _ = afloat(companion)
    around = sea.parts.surroundings
    known = companion.gate.known
    assert around.names == ("the water surface", "the target")
    assert around.planes[0][:3] == pytest.approx([0.0, 0.0, 1.0])
    assert around.planes[0][3] == pytest.approx(known.place_W_m[2] - known.depth_m, abs=1e-6)
    keep = sea.parts.pilot.inner.keep_off
    high = Pose(np.array([0.0, 0.0, around.planes[0][3] + 0.5 * 0.254 + 0.06]), np.array([1.0, 0.0, 0.0, 0.0]))
    velocity, blocks = keep.allowed(high, np.array([0.0, 0.0, -0.3]), np.zeros(3))
    assert blocks == "the water surface"
    assert velocity[2] > -0.1
