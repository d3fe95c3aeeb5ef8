"""The script on the autopilot, itself run by Lua 5.3 (`script_bench.py`): when it drives, and when it lets go."""

from __future__ import annotations

import math
import re
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from script_bench import Bench, stored, thrusts
from wakewise.core.errors import InputError
from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.script import SCRIPT_NAME, script_text, write_script

HALF = [0.5] * 8
TICK = protocol.LOOP_MS * 1000
"""Of the companion's clock, per loop of the script."""


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.load()
    made.enable()
    made.step()
    return made


def test_the_numbers_in_the_script_are_the_protocols() -> None:
    """What both must agree on is stated once for Python and once for Lua, and is the same."""
    said = dict(re.findall(r"^local (\w+) = (\d+)", script_text(), re.MULTILINE))
    both = {
        "VERSION": "SCRIPT_VERSION",
        "COMPANION": "COMPANION_COMPONENT",
        **{
            name: name
            for name in (
                "THRUST_MESSAGE",
                "THRUST_BYTES",
                "SLOTS",
                "FIRST_FUNCTION",
                "RIVAL_MS",
                "PARAMETER_TABLE",
                "DEFAULT_MODES",
            )
        },
    }
    assert {name: int(said[name]) for name in both} == {name: getattr(protocol, other) for name, other in both.items()}
    pairs = dict(
        pair
        for names, values in re.findall(r"^local (\w+(?:, \w+)+) = (\d+(?:, \d+)+)", script_text(), re.MULTILINE)
        for pair in zip(names.split(", "), values.split(", "), strict=True)
    )
    for name in (
        "THRUST_GROUP",
        "RELEASE_GROUP",
        "MIDDLE_US",
        "FULL_US",
        "HOLD_MS",
        "LOOP_MS",
        "STABILIZE",
        "ALT_HOLD",
    ):
        assert int(pairs[name]) == getattr(protocol, name)
    for name in ("BACKSTOP_MS", "PAUSE_MS"):
        assert int(said[name]) == getattr(protocol, name)
    assert int(pairs["MOST_AHEAD_US"]) == protocol.MOST_AHEAD_US
    assert int(pairs["MOST_BEHIND_US"]) == protocol.MOST_BEHIND_US
    assert int(said["STATE_MS"]) == 1000 * protocol.STATE_PERIOD_S
    for words in protocol.REASONS.values():
        assert f'"{words}"' in script_text()


def test_it_needs_no_more_than_32_bits() -> None:
    """ArduPilot's Lua has 32-bit integers and floats: no wider number is unpacked or written."""
    assert not re.search(r'unpack\("[^"]*(I[4-8]|i[5-8]|[jJlLTdn])', script_text())
    assert max(int(number) for number in re.findall(r"\b\d+\b", script_text())) < 2**31


def test_thrusts_become_pulses_on_the_motors_channels(bench: Bench) -> None:
    """Motor i is where its function is, and 1500 + 400 v us is what it gets."""
    bench.functions = {3: 33, 2: 34, 1: 35, 0: 36, 8: 37, 9: 38, 10: 39, 11: 40, 4: 59}
    values = [-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0, 0.001]
    bench.step(thrusts(values, 10))
    assert bench.pulses == {3: 1100, 2: 1300, 1: 1500, 0: 1600, 8: 1700, 9: 1800, 10: 1900, 11: 1500}
    assert bench.why == 0
    assert bench.floats[protocol.ENGAGED_NAME] == 1
    assert bench.floats[protocol.VERSION_NAME] == protocol.SCRIPT_VERSION


@given(st.lists(st.integers(1100, 1900), min_size=8, max_size=8), st.integers(0, 2**48 - 1))
@settings(max_examples=40, deadline=None)
def test_every_pulse_survives_the_wire(pulses: list[int], time_us: int) -> None:
    """A whole microsecond comes out as it went in, whatever the clock says."""
    bench = Bench()
    bench.load()
    bench.enable()
    bench.step(thrusts([(pulse - 1500) / 400 for pulse in pulses], time_us))
    assert list(bench.pulses.values()) == pulses


def test_zeros_that_mavlink_leaves_out_are_zeros(bench: Bench) -> None:
    """A payload cut after its last byte that is not zero reads the same; what lies behind it is not read."""
    cut = bytearray(thrusts(HALF[:4] + [0.0] * 4, 10))
    # Eight bytes of time and four numbers of four; group, target and component left out, too, are zero.
    cut[3] = 24
    cut[12 + 24 : 12 + 264] = b"\xaa" * 240
    bench.step(bytes(cut))
    assert list(bench.pulses.values()) == [1700] * 4 + [1500] * 4


def test_silence_gives_the_outputs_back_within_the_bound(bench: Bench) -> None:
    """The last message acts for 250 ms, and the script then ends it and says so; one that has stopped, by itself."""
    bench.step(thrusts(HALF, 10))
    sent_ms = bench.now_ms
    while bench.now_ms - sent_ms < protocol.HOLD_MS:
        assert len(bench.pulses) == 8
        bench.step()
    assert not bench.pulses
    assert bench.why == 4
    assert bench.now_ms - sent_ms <= protocol.HOLD_MS + protocol.LOOP_MS
    bench.step(thrusts(HALF, 10 + 20 * TICK))
    sent_ms = bench.now_ms
    bench.now_ms = sent_ms + protocol.BACKSTOP_MS - 1
    assert len(bench.pulses) == 8
    bench.now_ms += 1
    assert not bench.pulses
    assert 1000 * protocol.NEUTRAL_WITHIN_S >= protocol.BACKSTOP_MS


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"armed": False}, 2),
        ({"mode": protocol.ALT_HOLD}, 9),
        ({"mode": protocol.STABILIZE}, 9),
        ({"mode": protocol.POSHOLD}, 3),
        ({"mode": 250}, 3),
        ({"off": True}, 1),
    ],
)
def test_what_forbids_it_ends_it_in_one_loop(bench: Bench, change: dict[str, int], why: int) -> None:
    """Disarmed, in another mode, or switched off: no override is left, though thrusts stream on."""
    bench.step(thrusts(HALF, 10))
    assert bench.pulses
    for name, value in change.items():
        if name == "off":
            bench.parameters[protocol.ENABLE_PARAMETER] = 0.0
        else:
            setattr(bench, name, value)
    for i in range(1, 30):
        bench.step(thrusts(HALF, 10 + i * TICK))
        assert not bench.pulses
    assert bench.why == why
    assert bench.texts[-1][1] == f"{protocol.STATUS_PREFIX}{protocol.REASONS[why]}"


def test_after_a_change_of_mode_it_waits_for_a_pause(bench: Bench) -> None:
    """Who streams on is not obeyed; who was silent for half a second is."""
    bench.step(thrusts(HALF, 10))
    bench.mode = protocol.STABILIZE
    bench.step(*(thrusts(HALF, 10 + i * TICK) for i in range(1, 3)), times=2)
    silent = 0
    while bench.why == 9:
        silent += protocol.LOOP_MS
        bench.step()
    assert abs(silent - protocol.PAUSE_MS) <= 2 * protocol.LOOP_MS
    bench.step(thrusts(HALF, 10 + 100 * TICK))
    assert len(bench.pulses) == 8


ENDINGS = {
    "let go": lambda bench: bench.step(thrusts(HALF, 20 * TICK, group=protocol.RELEASE_GROUP)),
    "silent": lambda bench: bench.step(times=protocol.HOLD_MS // protocol.LOOP_MS + 1),
    "switched off": lambda bench: (bench.parameters.update({protocol.ENABLE_PARAMETER: 0.0}), bench.step()),
    "not a number": lambda bench: bench.step(thrusts([math.nan] * 8, 20 * TICK)),
    "two senders": lambda bench: bench.step(thrusts(HALF, 2**40)),
    "a time that cannot be": lambda bench: bench.step(thrusts(HALF, 2**48)),
}


@pytest.mark.parametrize("ending", ENDINGS)
def test_alt_hold_is_entered_anew_at_every_hand_back(bench: Bench, ending: str) -> None:
    """However it ends: out of ALT_HOLD in the turn in which the outputs are the autopilot's, and back in the next."""
    bench.mode = protocol.ALT_HOLD
    bench.step(thrusts(HALF, 10))
    assert len(bench.pulses) == 8
    assert not bench.modes
    ENDINGS[ending](bench)
    assert not bench.pulses
    assert bench.modes == [protocol.STABILIZE]
    bench.step(thrusts(HALF, 2**41))
    assert bench.modes == [protocol.STABILIZE, protocol.ALT_HOLD]
    bench.step(times=50)
    assert len(bench.modes) == 2


def test_the_mode_stays_the_pilots(bench: Bench) -> None:
    """None is set disarmed, nor in MANUAL or STABILIZE, nor after the pilot's own; a refusal is said."""
    for mode in (protocol.MANUAL, protocol.STABILIZE):
        bench.mode = mode
        bench.step(thrusts(HALF, 10 + mode * TICK))
        assert bench.pulses
        bench.step(times=60)
    bench.mode = protocol.ALT_HOLD
    bench.step(thrusts(HALF, 100 * TICK))
    assert bench.pulses
    bench.armed = False
    bench.step(times=2)
    assert not bench.pulses
    assert not bench.modes
    bench.armed = True
    bench.step(thrusts(HALF, 200 * TICK))
    bench.step(thrusts(HALF, 201 * TICK, group=protocol.RELEASE_GROUP))
    bench.mode = protocol.MANUAL
    bench.step(times=3)
    assert bench.modes == [protocol.STABILIZE]
    assert bench.mode == protocol.MANUAL
    bench.mode, bench.refused_modes = protocol.ALT_HOLD, (protocol.ALT_HOLD,)
    bench.step(times=60)
    bench.step(thrusts(HALF, 400 * TICK))
    bench.step(thrusts(HALF, 401 * TICK, group=protocol.RELEASE_GROUP), times=2)
    assert bench.texts[-1][1] == "Wakewise: ALT_HOLD refused, now STABILIZE"


def test_it_is_off_after_every_start() -> None:
    """A switch that was left on is off again after a reboot, also in what the autopilot has saved."""
    bench = Bench(parameters={"MAV_SYSID": 7.0, protocol.ENABLE_PARAMETER: 1.0})
    bench.load()
    assert bench.parameters[protocol.ENABLE_PARAMETER] == 0.0
    bench.step(thrusts(HALF, 10, system=7, target=7))
    assert not bench.pulses
    bench.enable()
    bench.step(thrusts(HALF, 20, system=7, target=7))
    assert len(bench.pulses) == 8


@pytest.mark.parametrize("who", [{"system": 255}, {"component": 190}, {"system": 2, "component": 191}])
def test_only_the_companion_is_obeyed(bench: Bench, who: dict[str, int]) -> None:
    """A ground station or another component that sends the same message moves nothing, and it is said."""
    bench.step(thrusts(HALF, 10, **who))
    assert not bench.overrides
    assert bench.why == 8


def test_a_stranger_does_not_interrupt_the_companion(bench: Bench) -> None:
    """Thrusts go on; who may not command may not stop either."""
    bench.step(thrusts(HALF, 10))
    bench.step(thrusts([-1.0] * 8, 5 * TICK, system=255), thrusts(HALF, TICK))
    assert list(bench.pulses.values()) == [1700] * 8


def test_messages_for_another_vehicle_are_none_of_its_business(bench: Bench) -> None:
    """Nothing moves and nothing is said."""
    bench.step(thrusts(HALF, 10, target=2))
    assert not bench.overrides
    assert bench.why == 4


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.001, -1.5, 3e38])
@pytest.mark.parametrize("slot", [0, 7])
def test_one_bad_number_refuses_all(bench: Bench, value: float, slot: int) -> None:
    """Nothing of the message acts, and what acted before it ends."""
    bench.step(thrusts(HALF, 10))
    bad = list(HALF)
    bad[slot] = value
    bench.step(thrusts(bad, 10 + TICK))
    assert not bench.pulses
    assert bench.why == (6 if math.isnan(value) else 5)


def test_six_motors_on_an_eight_motor_frame_are_refused(bench: Bench) -> None:
    """As many numbers as motors, in their slots, or nothing; the other way round as well."""
    bench.step(thrusts(HALF[:6], 10))
    assert not bench.overrides
    assert bench.why == 6
    bench.functions = {i: 33 + i for i in range(6)}
    bench.step(thrusts(HALF, 20))
    assert not bench.overrides
    bench.step(thrusts(HALF[:6], 30))
    assert list(bench.pulses.values()) == [1700] * 6


def test_an_overtaken_message_is_left_out(bench: Bench) -> None:
    """The same one twice, or one from up to 250 ms ago, changes nothing and stops nothing."""
    bench.step(thrusts(HALF, 1_000_000))
    late = [thrusts([0.0] * 8, 1_000_000 - behind) for behind in (0, 1, 50_000, protocol.MOST_BEHIND_US)]
    bench.step(*late)
    assert list(bench.pulses.values()) == [1700] * 8
    assert bench.why == 0


@pytest.mark.parametrize("apart_us", [-protocol.MOST_BEHIND_US - 1, protocol.MOST_AHEAD_US + 1, 2**47, -(2**24)])
def test_two_senders_stop_each_other_and_nobody_drives(bench: Bench, apart_us: int) -> None:
    """As long as both send the pilot has the outputs; a second after one falls silent the other drives."""
    start = 2**25
    bench.step(thrusts(HALF, start))
    for i in range(1, 20):
        bench.step(thrusts([-1.0] * 8, start + apart_us + (i - 1) * TICK), thrusts(HALF, start + i * TICK))
        assert not bench.pulses
    assert bench.why == 7
    alone = 0
    while not bench.pulses:
        alone += 1
        bench.step(thrusts(HALF, start + (20 + alone) * TICK))
        assert alone < 100
    assert protocol.RIVAL_MS <= alone * protocol.LOOP_MS <= protocol.RIVAL_MS + 2 * protocol.LOOP_MS
    assert list(bench.pulses.values()) == [1700] * 8


def test_a_replayed_flight_takes_the_helm_from_nobody(bench: Bench) -> None:
    """What was recorded a minute ago ends the override instead of acting."""
    recorded = [thrusts([-1.0] * 8, 1_000_000 + i * TICK) for i in range(5)]
    bench.step(thrusts(HALF, 61_000_000))
    for message in recorded:
        bench.step(message)
        assert not bench.pulses


def test_a_companion_that_started_again_is_believed_after_a_silence(bench: Bench) -> None:
    """Its clock may say anything once nobody has sent for a second."""
    bench.step(thrusts(HALF, 2**40))
    bench.step(times=protocol.RIVAL_MS // protocol.LOOP_MS + 1)
    bench.step(thrusts(HALF, 5))
    assert len(bench.pulses) == 8


def test_letting_go_ends_it_at_once(bench: Bench) -> None:
    """The message that lets go leaves no override, whatever its controls hold; thrusts may follow it."""
    bench.step(thrusts(HALF, 10))
    bench.step(thrusts([math.nan] * 8, 20, group=protocol.RELEASE_GROUP))
    assert not bench.pulses
    assert bench.why == 4
    bench.step(thrusts(HALF, 30))
    assert len(bench.pulses) == 8
    bench.step(thrusts(HALF, 40, group=2))
    assert not bench.pulses


def test_a_time_that_cannot_be_is_refused(bench: Bench) -> None:
    """Beyond 2^48 us, nine years, a clock is damage."""
    bench.step(thrusts(HALF, 2**48))
    assert not bench.overrides
    assert bench.why == 5


def test_the_pilot_may_allow_other_modes(bench: Bench) -> None:
    """WKW_MODES is a sum of powers of two, and what is no sum allows nothing."""
    bench.mode = protocol.POSHOLD
    bench.parameters[protocol.MODES_PARAMETER] = float(protocol.DEFAULT_MODES + (1 << protocol.POSHOLD))
    bench.step(thrusts(HALF, 10))
    assert len(bench.pulses) == 8
    bench.parameters[protocol.MODES_PARAMETER] = 0.0
    bench.step(thrusts(HALF, 20))
    assert not bench.pulses


@given(st.lists(st.binary(max_size=300), max_size=12), st.integers(0, 255), st.integers(0, 60))
@settings(max_examples=60, deadline=None)
def test_damage_never_drives(junk: list[bytes], length: int, at: int) -> None:
    """Bytes of any kind and length, and a good message with one byte changed in its head, never stop the script."""
    bench = Bench()
    bench.load()
    bench.enable()
    bench.step(*junk)
    assert not bench.pulses
    changed = bytearray(stored(_message(), system=255))
    changed[min(at, 11)] = length
    bench.step(bytes(changed))
    assert all(1100 <= pulse <= 1900 for pulse in bench.pulses.values())


def _message() -> object:
    from pymavlink.dialects.v20 import common

    return common.MAVLink_set_actuator_control_target_message(5, 0, 1, 1, HALF)


def test_its_state_is_told_twice_a_second_and_changes_at_once(bench: Bench) -> None:
    """A companion that hears it knows within half a second that the script is there."""
    bench.floats.clear()
    bench.step(times=int(1000 * protocol.STATE_PERIOD_S) // protocol.LOOP_MS)
    assert set(bench.floats) == {protocol.ENGAGED_NAME, protocol.REASON_NAME, protocol.VERSION_NAME}
    bench.step(thrusts(HALF, 10))
    assert bench.floats[protocol.ENGAGED_NAME] == 1
    flapping = len(bench.texts)
    for i in range(25):
        bench.armed = not bench.armed
        bench.step(thrusts(HALF, 10 + (i + 1) * TICK))
    assert len(bench.texts) - flapping <= 2
    assert all(len(text) <= 50 for _, text in bench.texts)


def test_the_script_is_in_the_package_and_is_written_whole(tmp_path: Path) -> None:
    """What `write_script` leaves is the file that is shipped; a folder that is a file is refused."""
    path = write_script(tmp_path / "new")
    assert path.name == SCRIPT_NAME
    assert path.read_text(encoding="utf-8") == script_text()
    with pytest.raises(InputError, match="a file is there"):
        write_script(path)


def test_a_wheel_brings_the_script(tmp_path: Path) -> None:
    """Built as it is published, the package has the script where it is read from."""
    from hatchling.builders.wheel import WheelBuilder

    root = Path(__file__).parents[2]
    (wheel,) = WheelBuilder(str(root)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(wheel) as archive:
        inside = archive.read("wakewise_ardusub/link/script/wakewise.lua").decode("utf-8")
    assert inside == script_text()
