"""Assisted flight by hand: goals that never jump, hold what they should, and let a mission go on where it was left."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from wakewise.core.geometry import Pose, quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState
from wakewise.operation import Scenario
from wakewise.operation.teleop.arbitration import BRAKING_M_S2
from wakewise.operation.teleop.assisted import assisted_pilot
from wakewise.operation.teleop.input import CENTRED, Controls
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.operation.teleop.resumable_mission import PACE_S
from wakewise.planning.kernels import least_gap
from wakewise.planning.problem import CLEARANCE_M
from wakewise.scene.missions import RoutePilot

DT_S = 0.02


class Hands:
    """Sticks as a function of time."""

    def __init__(self, at=lambda time_s: CENTRED):
        self.read = at


def sticks(forward=0.0, right=0.0, down=0.0, turn=0.0, tilt=0.0, pressed=()):
    return Controls(axes=np.array([forward, right, down, turn, tilt]), pressed=pressed)


@pytest.fixture(scope="module")
def parts():
    return Scenario.preset("quick", **{"mission.settle_s": 2.0}).parts()


@pytest.fixture(scope="module")
def tilting():
    return Scenario.preset("quick", vehicle="bluerov2-heavy", **{"mission.settle_s": 2.0}).parts()


class Flown:
    """A pilot whose vehicle is always at its goal; steps on demand."""

    def __init__(self, parts, hands=None, **operator):
        self.operator = OperatorState(OperatorSettings(**operator))
        self.hands = hands or Hands()
        self.pilot = assisted_pilot(parts, self.hands, self.operator)
        self.body, self.step, self.goals = parts.start, 0, []

    def until(self, time_s):
        while DT_S * self.step < time_s - 1e-9:
            goal = self.pilot.goal(DT_S * self.step, self.body)
            self.goals.append(goal)
            self.body, self.step = BodyState(X_WB=goal.X_WB, nu_B=goal.nu_B), self.step + 1
        return self

    @property
    def eye(self):
        return self.pilot.motion.camera(self.pilot.aim)[0]


def jumps(goals):
    """Largest steps of place, velocity in W, attitude and turn; and how far pose and twist differ (m/s)."""
    place, velocity, angle, turn, apart = 0.0, 0.0, 0.0, 0.0, 0.0
    for a, b in pairwise(goals):
        way = b.X_WB.p_m - a.X_WB.p_m
        rotation = rotvec_from_quat(quat_multiply(quat_conjugate(a.X_WB.q), b.X_WB.q))
        v, w = a.X_WB.R @ a.nu_B[:3], b.X_WB.R @ b.nu_B[:3]
        place, velocity = max(place, np.linalg.norm(way)), max(velocity, np.linalg.norm(w - v))
        angle = max(angle, np.linalg.norm(rotation))
        turn = max(turn, np.linalg.norm(a.X_WB.R @ a.nu_B[3:] - b.X_WB.R @ b.nu_B[3:]))
        apart = max(apart, np.linalg.norm(way / DT_S - 0.5 * (v + w)))
    return place, velocity, angle, turn, apart


def test_an_untouched_scan_is_the_missions_own(parts, tilting):
    """In mode scan from the start, goals are those of the route pilot, step for step."""
    for some in (parts, tilting):
        flown = Flown(some, mode="scan").until(12.0)
        route = RoutePilot(route=some.route, aim=some.aim)
        for k, goal in enumerate(flown.goals):
            other = route.goal(DT_S * k, flown.body)
            np.testing.assert_allclose(goal.X_WB.p_m, other.X_WB.p_m, atol=1e-9)
            np.testing.assert_allclose(goal.X_WB.R, other.X_WB.R, atol=1e-9)
            np.testing.assert_allclose(goal.nu_B, other.nu_B, atol=2e-4)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_goals_never_jump_whoever_takes_over_when(parts, tilting, seed):
    """Modes, assists and sticks at random instants: bounded steps of place, velocity and attitude; pose fits twist."""
    rng = np.random.default_rng(seed)
    now = [CENTRED]
    flown = Flown(tilting if seed % 2 else parts, Hands(lambda _: now[0]), mode="scan", gain=0.6)
    for instant in np.cumsum(rng.uniform(0.1, 4.0, 12)):
        flown.until(instant)
        flown.operator.set(
            mode=str(rng.choice(["operator", "operator", "hold", "scan"])),
            watch_target=bool(rng.integers(2)),
            orbit=bool(rng.integers(2)),
            method=str(rng.choice(["direct", "wake-aware"])),
        )
        now[0] = Controls(axes=rng.choice([-1.0, 0.0, 0.0, 1.0], 5) * rng.uniform(0.3, 1.0, 5))
    place, velocity, angle, turn, apart = jumps(flown.until(DT_S * flown.step + 4.0).goals)
    assert place < 0.6 * DT_S and velocity < 0.61 * DT_S and angle < 1.6 * DT_S and turn < 1.5 * DT_S
    assert apart < 0.01


def test_a_scan_goes_on_where_it_was_left(parts):
    """The mission's clock stands while the operator flies; then back at the mission's pace, and on from there."""
    now = [CENTRED]
    flown = Flown(parts, Hands(lambda _: now[0]), mode="scan").until(8.0)
    left_s, eye = flown.pilot.mission_s, flown.eye
    flown.operator.set(mode="operator")
    now[0] = sticks(right=1.0)
    flown.until(11.0)
    assert flown.pilot.mission_s == left_s and np.linalg.norm(flown.eye - eye) > 0.2
    now[0] = CENTRED
    flown.operator.set(mode="scan")
    fastest, before = 0.0, flown.eye
    while (flown.pilot._mode, flown.pilot._scan.phase) != ("scan", "flying"):
        flown.until(DT_S * (flown.step + 1))
        if flown.pilot._scan.phase == "returning":
            fastest = max(fastest, np.linalg.norm(flown.eye - before) / DT_S)
        before = flown.eye
        assert flown.step < 2000 and flown.pilot.mission_s == left_s
    np.testing.assert_allclose(flown.eye, eye, atol=1e-6)
    assert fastest == pytest.approx(parts.scenario.mission.speed_m_s, rel=0.02)
    flown.until(DT_S * flown.step + 3.0)
    assert flown.pilot.mission_s == pytest.approx(left_s + 3.0 - 0.5 * PACE_S, abs=0.03)


def test_a_scan_asks_for_its_photographs_on_its_own_clock(parts):
    """Each exposure of the route once, however often the mission is left meanwhile; "capture" by hand beside them."""
    flown = Flown(parts, mode="scan")
    asked = 0
    for k in range(5):
        flown.until(10.0 * k + 6.0).operator.set(mode="hold")
        flown.until(10.0 * k + 7.0).operator.set(mode="scan")
        asked += len(flown.pilot.taken())
    due = int(np.count_nonzero(parts.route.exposures_s <= flown.pilot.mission_s))
    assert asked == due > 0


def test_released_sticks_brake_and_the_place_lies_ahead(parts):
    """From 0.3 m/s the goal comes to rest v^2 / 2a ahead of where the stick was let go, and stays there to the bit."""
    flown = Flown(
        parts,
        Hands(lambda t: sticks(right=1.0) if t < 3.0 else CENTRED),
        mode="operator",
        gain=0.6,
        watch_target=False,
    ).until(3.0)
    let_go, v = flown.body.X_WB.p_m, np.linalg.norm(flown.pilot.velocity_W_m_s)
    assert v == pytest.approx(0.3, abs=1e-9)
    flown.until(6.0)
    assert np.linalg.norm(flown.body.X_WB.p_m - let_go) == pytest.approx(v**2 / (2.0 * BRAKING_M_S2), rel=0.03)
    assert not flown.pilot.velocity_W_m_s.any()
    held = flown.goals[-1].X_WB.p_m
    flown.body = BodyState(X_WB=parts.start.X_WB)  # carried off, or an estimate that slips
    assert np.array_equal(flown.until(6.1).goals[-1].X_WB.p_m, held)


def test_velocity_is_in_the_bodys_level_frame(parts):
    """Forward is along the heading and level, however the body is pitched; gain and precise mode scale it."""
    flown = Flown(parts, Hands(lambda _: sticks(forward=-1.0)), mode="operator", gain=0.4).until(3.0)
    heading = flown.body.X_WB.R[:, 0] * [1.0, 1.0, 0.0]
    v = flown.pilot.velocity_W_m_s
    np.testing.assert_allclose(v, -0.2 * heading / np.linalg.norm(heading), atol=1e-3)
    flown.operator.set(precise=True)
    assert np.linalg.norm(flown.until(6.0).pilot.velocity_W_m_s) == pytest.approx(0.06, abs=1e-6)


@pytest.mark.parametrize("vehicle", ["fixed", "tilting"])
def test_the_camera_stays_on_the_target(parts, tilting, vehicle):
    """Sideways and up by hand, the target stays within a degree of the view's axis; a joint spares the body's pitch."""
    some = tilting if vehicle == "tilting" else parts
    flown = Flown(some, Hands(lambda t: sticks(right=0.8, down=-0.4)), mode="operator").until(5.0)
    goal, aim = flown.goals[-1], flown.pilot.aim
    X_WC = goal.X_WB @ aim.mount(goal.tilt_rad)
    sight = some.surveyed_target.centre_W_m - X_WC.p_m
    assert X_WC.R[:, 2] @ sight / np.linalg.norm(sight) > np.cos(np.radians(1.0))
    pitch = np.degrees(np.arcsin(-goal.X_WB.R[2, 0]))
    assert abs(pitch) < 0.1 and abs(goal.tilt_rad) > 0.1 if vehicle == "tilting" else abs(pitch) > 5.0


@pytest.mark.parametrize("vehicle", ["fixed", "tilting"])
def test_an_orbit_keeps_its_range(parts, tilting, vehicle):
    """Right and up along the sphere the camera's range stays within 15 mm; forward sets another."""
    some = tilting if vehicle == "tilting" else parts
    now = [sticks(right=1.0, down=-0.5)]
    flown = Flown(some, Hands(lambda _: now[0]), mode="operator", orbit=True)
    centre = some.surveyed_target.centre_W_m

    def ranges(until_s):
        begins = flown.step
        flown.until(until_s)
        eyes = [(g.X_WB @ flown.pilot.aim.mount(g.tilt_rad)).p_m for g in flown.goals[begins:]]
        return np.linalg.norm(np.array(eyes) - centre, axis=1)

    first = ranges(6.0)
    assert np.ptp(first) < 0.015
    away = flown.eye - centre
    assert np.degrees(np.arctan2(-away[2], np.hypot(*away[:2]))) > 30.0
    now[0] = sticks(forward=1.0)
    nearer = ranges(7.0)
    assert nearer[-1] < first[-1] - 0.02
    now[0] = CENTRED
    ranges(9.5)
    now[0] = sticks(right=-1.0)
    assert np.ptp(ranges(13.0)) < 0.015


def test_nobody_at_the_sticks_means_stop_and_hold_and_is_said(parts):
    """A source that gives nothing, or raises, stops the vehicle; it is said once, and once more when it is back."""

    def lost(time_s):
        if 2.0 <= time_s < 4.0:
            raise OSError("unplugged")
        return None if 4.0 <= time_s < 6.0 else sticks(right=0.5)

    flown = Flown(parts, Hands(lost), mode="operator").until(5.0)
    assert not flown.pilot.velocity_W_m_s.any() and flown.pilot.controls is None
    assert flown.until(7.0).pilot.velocity_W_m_s.any()
    said = [note for note in flown.pilot.notes() if "sticks" in note.text]
    assert [(note.level, note.time_s) for note in said] == [("warn", 2.0), ("info", 6.0)]
    assert "unplugged" in said[0].text and flown.pilot.notes() == ()


def test_buttons_change_the_desk_or_wait_to_be_taken(parts):
    """Modes and gains act at once; photographs and the end are handed on, once, in order."""
    pressed = {1: ("operator", "capture"), 2: ("precise", "gain_up"), 3: ("capture", "stop")}
    flown = Flown(parts, Hands(lambda t: sticks(pressed=pressed.get(round(t / DT_S), ())))).until(0.2)
    assert flown.operator.state == OperatorSettings(mode="operator", precise=True, gain=0.6)
    assert flown.pilot.taken() == ("capture", "capture", "stop") and flown.pilot.taken() == ()


def test_the_dial_reaches_the_planner_little_by_little(parts):
    """w_track from 5 to 50 is ten times the obedience, by no more than 4 % a step."""
    flown = Flown(parts).until(0.1)
    assert flown.goals[-1].tracking_weight_scale == pytest.approx(1.0)
    flown.operator.set(w_track=50.0)
    flown.until(3.0)
    shares = np.array([goal.tracking_weight_scale for goal in flown.goals])
    assert shares[-1] == pytest.approx(10.0) and np.all(np.abs(np.diff(np.log(shares))) < 0.0401)


def test_the_leash_gives_way_at_a_bounded_pace(parts):
    """A vehicle that is suddenly a metre off does not drag the goal along in one step."""
    flown = Flown(parts, Hands(lambda _: sticks(right=0.5)), mode="operator").until(2.0)
    away = BodyState(X_WB=Pose(flown.body.X_WB.p_m + np.array([1.0, 0.0, 0.0]), flown.body.X_WB.q))
    goal = flown.pilot.goal(2.0, away)
    assert np.linalg.norm(goal.X_WB.p_m - flown.goals[-1].X_WB.p_m) < 0.8 * DT_S


def test_a_flight_without_a_mission_holds_instead(parts):
    """`scan` where there is nothing to scan is said and held."""
    from wakewise.scene.missions import open_route

    some = parts.replace(route=open_route(parts.surveyed_target.centre_W_m, 10.0), start=parts.start)
    flown = Flown(some, mode="scan").until(0.1)
    assert flown.operator.state.mode == "hold" and "no mission" in flown.pilot.notes()[0].text


@pytest.mark.parametrize("orbit", [False, True])
def test_sticks_run_into_nothing(parts, orbit):
    """Full stick at the target, then at the bed: the goal comes to rest at the clearance, and may leave again."""
    now = [sticks(forward=1.0)]
    flown = Flown(parts, Hands(lambda _: now[0]), mode="operator", gain=0.8, orbit=orbit)
    around, half = parts.surroundings, 0.5 * np.array(parts.vehicle.size_m)

    def gap():
        X_WB = flown.body.X_WB
        return least_gap(X_WB.p_m, X_WB.R, half, np.array(around.planes), np.array(around.spheres))

    for axes in (sticks(forward=1.0), sticks(down=1.0)):
        now[0] = axes
        for _ in range(12):
            flown.until(DT_S * flown.step + 0.5)
            assert gap() > CLEARANCE_M - 0.02
    assert "in the way" in flown.pilot.notes()[-1].text
    near = gap()
    now[0] = sticks(forward=-1.0, down=-0.3)
    flown.until(DT_S * flown.step + 3.0)
    assert gap() > near + 0.05


def test_an_estimate_that_is_no_number_moves_nothing(parts):
    """The commanded place stays finite and goes on where it was once there is an estimate again."""
    flown = Flown(parts, Hands(lambda _: sticks(right=0.5)), mode="operator").until(2.0)
    sound, lost = flown.body, np.full(3, np.nan)
    nowhere = SimpleNamespace(p_m=lost, R=np.full((3, 3), np.nan), q=np.full(4, np.nan))
    flown.body = SimpleNamespace(X_WB=nowhere, nu_B=np.full(6, np.nan))
    goal = flown.pilot.goal(2.0, flown.body)
    assert np.linalg.norm(goal.X_WB.p_m - sound.X_WB.p_m) < 0.01
    assert np.isfinite(flown.pilot.goal(2.02, sound).X_WB.p_m).all() and flown.pilot.deviation_pct is not None
