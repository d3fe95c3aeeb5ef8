"""The output gate: which thrusts it sends and which it does not, whatever it is given."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bottle import SESSION, SOURCES, THRUST, THRUSTS, Bottle
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.output_gate import RELEASES, TICK_S
from wakewise_ardusub.link.protocol import MOST_AHEAD_US, NEUTRAL_WITHIN_S, SESSION_STEP_US
from wakewise_ardusub.link.session_log import SessionLog, read_journal

SLACK_S = 1e-6
LIMITS = EngagementLimits()


def engaged(**more) -> Bottle:
    """A bottle whose output gate drives."""
    bottle = Bottle(**more)
    assert bottle.engage() == "engaged"
    bottle.run(1.0)
    assert bottle.gate.entry == 1
    assert bottle.thrusts
    return bottle


def test_thrusts_go_out_while_engaged():
    """Decided ten times a second, sent at least twenty times: a message that is lost does no harm."""
    bottle = engaged()
    gaps = np.diff(bottle.thrusts)
    assert gaps.max() <= 0.06 + SLACK_S
    _, _, fields = next(sent for sent in bottle.sent if sent[1] == THRUST)
    assert fields["controls"] == [0.5] * 8
    assert (fields["target_system"], fields["target_component"], fields["group_mlx"]) == (1, 1, 0)


def test_times_of_thrusts_only_grow():
    """The script takes what is newer than the last, so no two messages have one time, released or not."""
    bottle = engaged()
    bottle.gate.press()
    bottle.run(0.2)
    times = [fields["time_usec"] for _, name, fields in bottle.sent if name == THRUST]
    assert all(b > a for a, b in itertools.pairwise(times))


def test_two_companions_on_one_clock_are_two_senders():
    """Their times begin further apart than any message may be ahead, so script and output gate tell them apart."""
    times = []
    for session in np.random.default_rng(1).integers(1, 2**31, 2):
        bottle = engaged(session=int(session))
        times.append({fields["time_usec"] for _, name, fields in bottle.sent if name == THRUST})
    apart = np.subtract.outer(*map(list, times))
    assert np.abs(apart).min() > MOST_AHEAD_US
    for time_us in times[0]:  # as the second hears the first
        bottle.say("SET_ACTUATOR_CONTROL_TARGET", component=191, time_usec=time_us, group_mlx=0)
    assert "another program sends thrusts" in bottle.gate.engagement.why


def test_sessions_drawn_at_random_are_apart_and_fit_the_script():
    """Of a hundred thousand pairs none is confused, and the latest begins years before 48 bits of microseconds end."""
    sessions = np.random.default_rng(2).integers(1, 2**31, (100_000, 2))
    assert (np.abs(np.diff(sessions)) * SESSION_STEP_US > MOST_AHEAD_US).all()
    years_us = 4 * 365 * 86_400 * 1_000_000
    assert 2**31 * SESSION_STEP_US + years_us < 2**48


def test_nothing_goes_out_without_consent():
    """All is well for ten seconds, and no thrust is sent; neither is one that a controller hands over unasked."""
    bottle = Bottle()
    bottle.run(10.0)
    assert bottle.gate.engagement.state == "ready"
    assert not bottle.gate.command(THRUSTS, 0)
    assert not bottle.gate.command(THRUSTS, 1)
    assert not bottle.thrusts


def test_listening_only_never_engages():
    """With --listen-only consent is refused in words."""
    bottle = Bottle(listen_only=True)
    assert bottle.engage() == "listening only: never engages"
    bottle.run(1.0)
    assert not bottle.thrusts


LOSSES = {
    "pose": lambda b: b.silent.add("pose"),
    "telemetry": lambda b: b.silent.add("attitude"),
    "operator": lambda b: b.silent.add("sticks"),
    "link": lambda b: b.silent.update(SOURCES),
    "disarmed": lambda b: (setattr(b, "armed", False), b.beat()),
    "mode": lambda b: (setattr(b, "mode", 16), b.beat()),
    "another allowed mode": lambda b: (setattr(b, "mode", 2), b.beat()),
    "rival thrusts": lambda b: b.say("SET_ACTUATOR_CONTROL_TARGET", component=191, time_usec=5, group_mlx=0),
    "rival heartbeat": lambda b: b.say("HEARTBEAT", component=191, custom_mode=SESSION + 1, type=18),
    "second ground station": lambda b: b.stick(system=254),
    "mode command": lambda b: b.say("COMMAND_LONG", system=255, component=190, target_system=1, command=176),
    "channels overridden": lambda b: b.say(
        "RC_CHANNELS_OVERRIDE",
        system=255,
        component=190,
        target_system=1,
        **{f"chan{i}_raw": 1500 for i in range(1, 7)},
    ),
    "controller": lambda b: setattr(b, "deciding", False),
    "clock ahead": lambda b: setattr(b, "boot_s", b.boot_s + 100.0),
    "clock back": lambda b: setattr(b, "boot_s", 0.0),
    "too deep": lambda b: setattr(b, "at", (0.0, 0.0, 60.0)),
    "too far": lambda b: setattr(b, "at", (0.0, 20.0, 2.0)),
    "tilted": lambda b: setattr(b, "roll_rad", 1.2),
    "parameter": lambda b: b.parameter("MOT_1_DIRECTION", -1.0),
    "button": lambda b: b.parameter("BTN3_FUNCTION", 4.0),
    "operator takes over": lambda b: b.gate.press(),
    "end": lambda b: b.gate.end("Ctrl-C"),
}


@pytest.mark.parametrize("loss", sorted(LOSSES))
def test_after_any_loss_thrusts_end_in_time(loss):
    """From the last of what was lost, no thrust is sent, and the script told to let go, within the bound less a loop.

    Nothing is sent after that until the operator consents anew, though all be well again.
    """
    bottle = engaged()
    at_s = bottle.now_s
    LOSSES[loss](bottle)
    bottle.run(2.0)
    assert bottle.gate.entry is None
    last_s, first_release_s = bottle.thrusts[-1], bottle.releases[0]
    assert last_s - at_s <= 0.25 + SLACK_S
    assert first_release_s - at_s <= NEUTRAL_WITHIN_S - TICK_S + SLACK_S
    assert first_release_s >= last_s
    assert len(bottle.releases) == RELEASES
    bottle.silent.clear()
    bottle.run(3.0)
    assert bottle.thrusts[-1] == last_s


def test_a_heartbeat_alone_that_stays_away_ends_it_too():
    """Heartbeats come once a second: with all else fresh it ends two and a half after the last."""
    bottle = engaged()
    at_s = bottle.gate.known.heartbeat_s
    bottle.silent.add("heartbeat")
    bottle.run(4.0)
    assert bottle.gate.entry is None
    assert bottle.releases[0] - at_s <= LIMITS.heartbeat_s + TICK_S + SLACK_S


def test_a_script_that_falls_silent_ends_it():
    """The script says twice a second that it is there; it acts by itself, so three words may be missing."""
    bottle = engaged()
    at_s = bottle.now_s
    bottle.silent.add("script")
    bottle.run(3.0)
    assert bottle.gate.entry is None
    assert bottle.gate.engagement.why.startswith("no script on the autopilot for")
    assert bottle.releases[0] - at_s <= LIMITS.script_s + 0.5 + TICK_S + SLACK_S


def test_a_process_that_stood_still_lets_go():
    """After half a second asleep the first thing that goes out is the release, not the thrusts of before."""
    bottle = engaged()
    before = len(bottle.sent)
    bottle.now_s += 0.5
    bottle.gate.tick()
    assert [fields["group_mlx"] for _, name, fields in bottle.sent[before:] if name == THRUST] == [1]


def test_thrusts_whose_own_call_ends_the_engagement_are_not_sent():
    """The position grew too old since the last tick: the call finds it out, and nothing follows the release."""
    bottle = engaged()
    before, entry = len(bottle.sent), bottle.gate.entry
    bottle.now_s += LIMITS.pose_s + TICK_S
    assert bottle.gate.entry == entry
    assert not bottle.gate.command(THRUSTS, entry)
    assert bottle.gate.entry is None
    assert bottle.gate.engagement.why.startswith("no ")
    assert [fields["group_mlx"] for _, name, fields in bottle.sent[before:] if name == THRUST] == [1]
    bottle.run(0.5)
    assert bottle.thrusts[-1] < bottle.releases[0]


@pytest.mark.parametrize("ends", ["pose", "operator takes over", "end"])
def test_letting_go_is_said_three_times(ends):
    """At once and with the next ticks: two of them may be lost, and the pilot has the sticks at the third."""
    bottle = engaged()
    LOSSES[ends](bottle)
    bottle.run(1.0)
    assert len(bottle.releases) == 3
    assert 0.02 - SLACK_S <= np.ptp(bottle.releases) <= 0.04 + SLACK_S
    assert bottle.gate.releases_sent == 3


@pytest.mark.parametrize("twist", [[1.5, 0.0, 0.0], [0.0, -1.1, 0.0], [0.7, 0.7, 0.7]])
def test_a_speed_that_only_the_estimator_knows_ends_it(twist):
    """The autopilot says that it stands still; the larger of both counts."""
    bottle = engaged()
    fast = BodyState(X_WB=Pose(np.array(bottle.at), np.array([1.0, 0.0, 0.0, 0.0])), nu_B=np.array([*twist, 0, 0, 0]))
    bottle.gate.estimated(fast)
    bottle.now_s += TICK_S
    bottle.gate.tick()
    assert bottle.gate.entry is None
    assert bottle.gate.engagement.why == f"{np.linalg.norm(twist):.2f} m/s, allowed 1 m/s"


def test_thrusts_of_an_engagement_before_are_not_sent():
    """A controller that answers late hands over thrusts of an engagement that is over; the next does not get them."""
    bottle = engaged()
    bottle.gate.press()
    bottle.run(1.5)
    assert bottle.gate.press() == "engaged"
    count = len(bottle.thrusts)
    assert not bottle.gate.command(THRUSTS, 1)
    assert len(bottle.thrusts) == count
    assert bottle.gate.command(THRUSTS, 2)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_thrusts_that_are_no_numbers_are_not_sent(wrong):
    """One thrust of eight that is not finite, and none goes out."""
    bottle = engaged()
    count = len(bottle.thrusts)
    assert not bottle.gate.command(np.array([*THRUSTS[:7], wrong]), 1)
    assert len(bottle.thrusts) == count


def test_its_own_echo_is_no_rival():
    """A router may hand back what was sent: thrusts and heartbeats of its own change nothing."""
    bottle = engaged()
    for _, name, fields in list(bottle.sent):
        if name in (THRUST, "heartbeat"):
            bottle.say(name.upper(), component=191, **dict(fields))
    bottle.run(0.5)
    assert bottle.gate.entry == 1


def test_the_pilots_button_consents_and_releases():
    """The button given as engage does both; what other buttons mean is handed to the flight, once a press."""
    bottle = Bottle()
    bottle.run(1.2)
    bottle.buttons = 1 << 3
    bottle.run(0.5)
    assert bottle.gate.entry == 1
    bottle.buttons = 1 << 4
    bottle.run(0.5)
    assert bottle.gate.pressed() == ("capture",)
    bottle.buttons = 1 << 3
    bottle.run(0.1)
    assert bottle.gate.entry is None


def test_it_beats_as_a_companion_and_reports_twice_a_second():
    """Heartbeats are those of an onboard controller, once a second; figures go out as named values, each twice."""
    bottle = Bottle()
    bottle.gate.figures = {"WW_D": 0.25, "WW_SAVED": math.nan}
    bottle.run(10.0)
    beats = [fields for _, name, fields in bottle.sent if name == "heartbeat"]
    assert {fields["type"] for fields in beats} == {18}
    assert 9 <= len(beats) <= 11
    values = [(fields["name"], fields["value"]) for _, name, fields in bottle.sent if name == "named_value_float"]
    assert set(values) == {(b"WW_D", 0.25)}
    assert 19 <= len(values) <= 21


def test_what_is_missing_is_asked_for():
    """A vehicle that sends neither attitude nor parameters is asked for them, and no more once they come."""
    bottle = Bottle()
    bottle.gate.known = bottle.gate.known.__class__(system=1, session=SESSION)
    bottle.silent.update({"attitude", "pose"})
    bottle.run(5.0)
    names = [name for _, name, _ in bottle.sent]
    assert names.count("param_request_read") >= 5
    assert names.count("command_long") >= 6
    bottle.silent.clear()
    bottle.parameters()
    bottle.run(4.0)
    asked = len(bottle.sent)
    bottle.run(5.0)
    assert {name for _, name, _ in bottle.sent[asked:]} == {"heartbeat"}


def test_every_change_of_state_is_in_the_journal(tmp_path):
    """Each transition with its reason, in order; news that repeat are written down now and then."""
    journal = SessionLog(tmp_path / "journal.jsonl")
    bottle = engaged(journal=journal)
    for _ in range(50):
        bottle.say("COMMAND_LONG", system=255, component=190, target_system=1, command=176)
    bottle.run(3.0)
    bottle.gate.end("Ctrl-C")
    journal.close()
    lines, _ = read_journal(tmp_path / "journal.jsonl")
    states = [(line["before"], line["after"]) for line in lines if line["event"] == "state"]
    assert states == [
        ("off", "listening"), ("listening", "ready"), ("ready", "engaged"), ("engaged", "refused"),
        ("refused", "listening"), ("listening", "ready"), ("ready", "off"),
    ]  # fmt: skip
    assert sum(line["event"] == "takeover" for line in lines) == 1
    refused = next(line for line in lines if line.get("after") == "refused")
    assert refused["reason"] == "system 255 set the mode"


def test_a_cable_pulled_out_does_not_end_the_watch():
    """Sending that fails is counted, and the watch goes on."""
    bottle = engaged()

    def fails(name, fields):
        raise OSError(101, "Network is unreachable")

    bottle.gate._send = fails
    bottle.run(0.5)
    assert bottle.gate.unsent > 0


EVENTS = st.sampled_from([
    "press", "command", "tick", "arm", "disarm", "manual", "hold", "attitude", "pose", "sticks", "depth", "script",
    "rival", "takeover", "estimate", "well", "well", "run", "release", "jump",
])  # fmt: skip
STEPS = st.lists(st.tuples(st.sampled_from([0.0, 0.01, 0.02, 0.1, 0.25, 0.6]), EVENTS), max_size=60)


@given(steps=STEPS)
@example(steps=[(0.0, "run"), (0.0, "press"), (0.02, "command"), (0.0, "disarm"), (0.0, "command"), (0.02, "tick")])
@settings(max_examples=150, deadline=None)
def test_never_a_thrust_while_disarmed_nor_after_a_loss(steps):
    """For any sequence of events: whenever a thrust goes out, the vehicle was last heard to be armed and in an allowed
    mode, attitude, position and sticks were heard within their limits, and the operator had consented.
    """
    bottle = Bottle()
    bottle.run(1.2)
    last = dict.fromkeys(("attitude", "pose", "sticks"), bottle.now_s)
    checked, pressed = 0, False
    for dt_s, event in steps:
        bottle.now_s += dt_s
        boot_ms = round(1e3 * (bottle.now_s - 1000.0 + bottle.boot_s))
        match event:
            case "press":
                bottle.gate.press()
                pressed = True
            case "command":
                bottle.gate.command(THRUSTS, bottle.gate.engagement.entries)
            case "tick":
                bottle.gate.tick()
            case "arm" | "disarm":
                bottle.armed = event == "arm"
                bottle.beat()
            case "manual" | "hold":
                bottle.mode = 19 if event == "manual" else 2
                bottle.beat()
            case "attitude":
                bottle.say(
                    "ATTITUDE", time_boot_ms=boot_ms, roll=0, pitch=0, yaw=0, rollspeed=0, pitchspeed=0, yawspeed=0
                )
                last["attitude"] = bottle.now_s
            case "pose":
                bottle.say("LOCAL_POSITION_NED", time_boot_ms=boot_ms, x=0, y=0, z=2, vx=0, vy=0, vz=0)
                last["pose"] = bottle.now_s
            case "sticks":
                bottle.stick()
                last["sticks"] = bottle.now_s
            case "rival":
                bottle.say("SET_ACTUATOR_CONTROL_TARGET", component=191, time_usec=5, group_mlx=0)
            case "takeover":
                bottle.stick(system=250)
                last["sticks"] = bottle.now_s
            case "release":
                bottle.gate.release("asked")
            case "jump":
                bottle.boot_s += 3.0
            case "well" | "run":
                bottle.run(0.1 if event == "well" else 1.3)
                last = dict.fromkeys(last, bottle.now_s)
        for at_s, name, fields in bottle.sent[checked:]:
            if name != THRUST or fields["group_mlx"] != 0:
                continue
            assert bottle.armed
            assert bottle.mode in LIMITS.modes
            assert pressed
            if event not in ("well", "run"):
                assert at_s - last["attitude"] <= LIMITS.telemetry_s + SLACK_S
                assert at_s - last["pose"] <= LIMITS.pose_s + SLACK_S
                assert at_s - last["sticks"] <= LIMITS.operator_s + SLACK_S
        checked = len(bottle.sent)


KEYS = [
    "roll", "pitch", "yaw", "x", "y", "z", "r", "q", "usec", "time_usec", "time_boot_ms", "buttons", "target", "type",
    "name", "value", "param_id", "param_value", "base_mode", "custom_mode", "autopilot", "target_system", "command",
]  # fmt: skip


@given(data=st.data())
@settings(max_examples=100, deadline=None)
def test_messages_that_say_nonsense_do_no_harm(data):
    """Any message of a name that is known, with any fields: nothing is raised, and nothing engages."""
    bottle = Bottle()
    value = st.one_of(st.none(), st.integers(-(2**70), 2**70), st.floats(), st.text(max_size=4), st.binary(max_size=4))
    names = st.sampled_from(sorted(bottle_names()))
    keys = st.sampled_from(KEYS)
    for _ in range(10):
        fields = data.draw(st.dictionaries(keys, value, max_size=12))
        bottle.gate.take(
            MavlinkMessage(
                data.draw(st.integers(0, 255)), data.draw(st.sampled_from([1, 190, 191])), data.draw(names), fields
            )
        )
        bottle.now_s += 0.02
        bottle.gate.tick()
    assert not bottle.thrusts


def bottle_names() -> frozenset[str]:
    """Messages that are looked into."""
    from wakewise_ardusub.link.message_state import WANTED

    return WANTED
