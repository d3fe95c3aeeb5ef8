"""The state machine: who may drive, and for which reasons not."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise_ardusub.link.engagement_fsm import (
    FAULTS,
    REST_S,
    EngagementInputs,
    EngagementLimits,
    EngagementState,
    faults,
)
from wakewise_ardusub.link.protocol import SCRIPT_VERSION

LIMITS = EngagementLimits(battery_V=13.0)
WELL = EngagementInputs(
    now_s=10.0,
    armed=True,
    mode=19,
    mode_name="MANUAL",
    heartbeat_s=0.5,
    telemetry_s=0.02,
    pose_s=0.05,
    operator_s=0.04,
    script_s=0.3,
    loop_s=0.05,
    script_version=SCRIPT_VERSION,
    acts=False,
    depth_m=2.0,
    distance_m=1.0,
    tilt_rad=0.1,
    speed_m_s=0.2,
    battery_V=15.0,
)
AMISS = {
    "duplicate": {"duplicate": "another program"},
    "clock": {"clock": "it jumped"},
    "stopped": {"standstill_s": 0.4},
    "disarmed": {"armed": False},
    "mode": {"mode": 16, "mode_name": "POSHOLD"},
    "takeover": {"takeover": "system 254 set the mode"},
    "heartbeat": {"heartbeat_s": 2.6},
    "telemetry": {"telemetry_s": 0.21},
    "pose": {"pose_s": 0.21},
    "operator": {"operator_s": 0.21},
    "script": {"script_s": 1.6},
    "parameters": {"parameters": "MOT_1_DIRECTION: 0, must be 1 or -1"},
    "late": {"thrusts_s": 0.26},
    "survey": {"survey": "no distance of the rangefinder"},
    "depth": {"depth_m": 60.0},
    "distance": {"distance_m": 5.1},
    "tilt": {"tilt_rad": math.radians(50.0)},
    "speed": {"speed_m_s": 1.2},
    "battery": {"battery_V": 12.9},
}


def engaged(facts: EngagementInputs = WELL) -> EngagementState:
    """An engagement that drives."""
    return EngagementState().begun(9.0).judged(facts, LIMITS).consented(facts, LIMITS)


def test_every_kind_of_fault_is_tried_here():
    """There is a way to be amiss for each kind of fault, and no other."""
    assert set(AMISS) == set(FAULTS)


def test_nothing_engages_by_itself():
    """All may be well for ever: without consent it is ready and no more."""
    now = EngagementState().begun(0.0)
    for k in range(100):
        now = now.judged(replace(WELL, now_s=float(k)), LIMITS)
    assert now.state == "ready"


def test_consent_engages_where_all_is_well():
    """Consent engages it, and it stays engaged while nothing is amiss."""
    assert engaged().judged(replace(WELL, now_s=11.0), LIMITS).state == "engaged"


@pytest.mark.parametrize("kind", FAULTS)
def test_each_fault_ends_an_engagement(kind):
    """One thing amiss and it is refused, with that as the reason; consent is asked for anew after a rest."""
    ill = replace(WELL, now_s=11.0, **AMISS[kind])
    now = engaged().judged(ill, LIMITS)
    assert now.state == "refused"
    assert [t.kind for t in now.told] == [kind]
    again = now.consented(replace(WELL, now_s=11.1), LIMITS)
    assert again.state == "refused"
    rested = again.judged(replace(WELL, now_s=11.0 + REST_S), LIMITS).judged(replace(WELL, now_s=12.5), LIMITS)
    assert rested.state == "ready"


@pytest.mark.parametrize("kind", [k for k in FAULTS if k not in ("late", "stopped")])
def test_each_fault_keeps_consent_from_counting(kind):
    """Consent while something is amiss changes nothing, and is forgotten."""
    ill = replace(WELL, **AMISS[kind])
    now = EngagementState().begun(9.0).consented(ill, LIMITS)
    assert now.state == "listening"
    assert now.judged(WELL, LIMITS).state == "ready"


def test_the_gravest_fault_is_the_reason():
    """Of several faults the first of the list is told."""
    ill = replace(WELL, armed=False, pose_s=3.0, battery_V=3.0)
    assert engaged().judged(ill, LIMITS).why == "disarmed"


def test_what_was_never_heard_is_amiss():
    """Facts of a vehicle of which nothing is known fit no limit."""
    kinds = {fault.kind for fault in faults(EngagementInputs(now_s=0.0), LIMITS, engaged=False)}
    expected = "disarmed mode heartbeat telemetry pose operator script late depth distance tilt speed battery"
    assert kinds == set(expected.split())


def test_a_script_of_another_version_is_refused():
    """The companion drives only the script that it was made with."""
    found = faults(replace(WELL, script_version=1), LIMITS, engaged=False)
    assert [fault.text for fault in found] == [f"script of version 1, this program needs {SCRIPT_VERSION}"]


def test_a_script_that_does_not_act_ends_the_engagement():
    """Engaged for two of its reports, and it says that it does not act."""
    idle = replace(WELL, engaged_s=2.0, acts=False, script_s=0.1)
    assert engaged().judged(idle, LIMITS).why == "the script does not act on the thrusts"
    assert engaged().judged(replace(idle, acts=True), LIMITS).state == "engaged"
    assert engaged().judged(replace(idle, engaged_s=0.5), LIMITS).state == "engaged"


def test_release_gives_the_sticks_back():
    """The operator takes the sticks at any time, and a session that ends does so for good."""
    assert engaged().released(11.0).state == "listening"
    ended = engaged().ended(11.0, "Ctrl-C")
    assert ended.state == "off"
    assert ended.judged(WELL, LIMITS).consented(WELL, LIMITS).state in ("off",)


AGES = st.floats(0.0, 5.0)
ANY = st.builds(
    EngagementInputs,
    now_s=st.just(0.0),
    armed=st.sampled_from([True, True, True, False, None]),
    mode=st.sampled_from([19, 19, 0, 0, 2, 2, 16, None]),
    mode_before=st.sampled_from(["", "", "", "MANUAL"]),
    heartbeat_s=AGES,
    telemetry_s=st.floats(0.0, 0.3),
    pose_s=st.floats(0.0, 0.3),
    operator_s=st.floats(0.0, 0.3),
    script_s=st.floats(0.0, 2.0),
    script_version=st.sampled_from([SCRIPT_VERSION] * 3 + [1, None]),
    acts=st.sampled_from([True, False, None]),
    loop_s=st.floats(0.0, 0.6),
    thrusts_s=st.floats(0.0, 0.3),
    engaged_s=st.floats(0.0, 5.0),
    standstill_s=st.floats(0.0, 0.3),
    duplicate=st.sampled_from(["", "", "", "rival"]),
    clock=st.sampled_from(["", "", "", "jump"]),
    takeover=st.sampled_from(["", "", "", "other"]),
    depth_m=st.floats(0.0, 60.0) | st.just(math.nan),
    distance_m=st.floats(0.0, 6.0),
    tilt_rad=st.floats(0.0, 1.0),
    speed_m_s=st.floats(0.0, 1.2),
    battery_V=st.floats(12.0, 17.0),
)
MOVES = st.lists(st.tuples(st.sampled_from(["judge", "judge", "consent", "release", "end"]), ANY | st.just(WELL)))


@given(moves=MOVES)
@settings(max_examples=200, deadline=None)
def test_engaged_only_while_nothing_is_amiss(moves):
    """Whatever happens in whatever order, after any move it is engaged only if armed, allowed, fresh and in limits."""
    now = EngagementState().begun(0.0)
    for k, (move, facts) in enumerate(moves):
        at = replace(facts, now_s=float(k))
        before = now
        now = {
            "judge": lambda a=at, e=now: e.judged(a, LIMITS),
            "consent": lambda a=at, e=now: e.consented(a, LIMITS),
            "release": lambda a=at, e=now: e.released(a.now_s),
            "end": lambda a=at, e=now: e.ended(a.now_s, "end"),
        }[move]()
        if move in ("judge", "consent") and now.state == "engaged":
            assert not faults(at, LIMITS, engaged=before.state == "engaged")
            assert at.armed is True
            assert at.mode in LIMITS.modes
        if now.state == "engaged" and before.state != "engaged":
            assert move == "consent"


@given(facts=ANY)
@settings(max_examples=200, deadline=None)
def test_every_fault_is_in_words(facts):
    """A fault says what is amiss in one line, with neither nan nor inf in it."""
    for fault in faults(facts, LIMITS, engaged=True):
        assert fault.text
        assert "\n" not in fault.text
        assert "nan" not in fault.text
        assert "inf" not in fault.text


def test_limits_are_all_used():
    """Each limit, made impossible, keeps a vehicle out that fits otherwise."""
    tightest = {
        "depth_m": (8.0, 9.0), "modes": frozenset(), "battery_V": 100.0, "thrusts_s": -1.0, "standstill_s": -1.0,
    }  # fmt: skip
    for field in fields(EngagementLimits):
        hard = replace(LIMITS, **{field.name: tightest.get(field.name, -1.0)})
        assert faults(WELL, hard, engaged=True), field.name
