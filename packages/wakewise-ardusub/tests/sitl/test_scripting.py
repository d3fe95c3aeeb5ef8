"""The stand-in's scripting engine: turns, bindings, budget, memory."""

import sys

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.core.errors import MissingExtra
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.sitl.inprocess_session import InProcessSession
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot

HEAVY = load_vehicle("bluerov2-heavy")


def _flown(text: str, seconds: float = 0.5, **values: float) -> InProcessSession:
    return InProcessSession(HEAVY, scripts={"own.lua": text}, values=values).run(seconds)


def test_a_script_has_its_turns() -> None:
    """As often as it asks for, by the stand-in's own time."""
    flight = _flown(
        "local n = 0\nfunction turn() n = n + 1 gcs:send_text(6, 'turn ' .. n) return turn, 100 end\nreturn turn()",
        1.05,
    )
    assert [text for text in flight.texts() if text.startswith("turn")] == [f"turn {n}" for n in range(1, 12)]


def test_a_script_without_a_loop_runs_once() -> None:
    """It is done, and no fault."""
    flight = _flown("gcs:send_text(6, 'once')")
    assert flight.texts() == ["once"]
    assert flight.autopilot.script_faults == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("while true do end", "exceeded time limit"),
        ("while true do pcall(function() while true do end end) end", "exceeded time limit"),
        ("local t = {} while true do t[#t + 1] = string.rep('x', 1000) .. #t end", "memory"),
        ("no:such()", "nil value"),
        ("mavlink:send_flowers(1)", "nil value"),
        ("return 1 +", "near"),
        ("return update, 100", "did not return"),
        ("return function() end, -5", "did not return"),
        ("SRV_Channels:set_output_pwm_chan_timeout('a', 1500, 10)", "integer expected"),
        ("SRV_Channels:set_output_pwm_chan_timeout(1.5, 1500, 10)", "integer expected"),
        ("param:get(7)", "string expected"),
        ("Parameter('NO_SUCH')", "No parameter: NO_SUCH"),
        ("os.exit()", "nil value"),
        ("io.open('x')", "nil value"),
        ("python.eval('1')", "nil value"),
        ("debug.sethook()", "nil value"),
        ("error('its own')", "its own"),
    ],
)
def test_a_script_that_fails_is_stopped_and_said(text: str, words: str) -> None:
    """The autopilot flies on without it."""
    flight = _flown(text, SCR_VM_I_COUNT=2_000_000 if "rep" in text else 10_000)
    (fault,) = flight.autopilot.script_faults
    assert words in fault
    assert sum(said.startswith("Lua: own.lua") for said in flight.texts()) == 1
    assert flight.autopilot.arm()


def test_numbers_of_time_wrap_like_the_firmwares() -> None:
    """Values of 32 bits without a sign, with the operators that they have there."""
    flight = _flown(
        "local a = uint32_t(5) - uint32_t(7)\n"
        "gcs:send_text(6, tostring(a) .. ' ' .. a:toint() .. ' ' .. tostring(millis() - millis() == uint32_t(0)))"
    )
    assert flight.texts() == ["4294967294 -2 true"]


def test_its_parameters_are_the_ground_stations_too() -> None:
    """A table and its parameters; one that is there keeps its value, a key of another prefix is refused."""
    flight = _flown(
        "assert(param:add_table(5, 'OWN_', 2))\nassert(param:add_param(5, 1, 'A', 3))\n"
        "assert(not param:add_table(5, 'HIS_', 2))\nassert(not param:add_param(5, 3, 'B', 1))\n"
        "local a = Parameter('OWN_A')\nassert(a:set_and_save(4) and a:get() == 4)\n"
        "assert(param:set('OWN_A', 6) and param:get('OWN_A') == 6 and not param:set('OWN_Z', 1))"
    )
    assert flight.autopilot.script_faults == []
    assert flight.autopilot.parameters.get("OWN_A") == 6.0


def test_an_override_lasts_as_long_as_it_says() -> None:
    """200 ms at 100 loops a second are 20 loops; the output is the autopilot's again then."""
    flight = _flown("SRV_Channels:set_output_pwm_chan_timeout(2, 1700, 200)\ngcs:send_named_float('SET', 1)")
    driven = [moment for moment in flight.moments if moment.overridden]
    assert 19 <= len(driven) <= 20
    assert driven[0].pulses_us[2] == 1700
    assert flight.moments[-1].pulses_us[2] == 1500


def test_without_scripting_switched_on_nothing_runs() -> None:
    """SCR_ENABLE of 0."""
    assert _flown("gcs:send_text(6, 'here')", SCR_ENABLE=0.0).texts() == []


def test_without_lua_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only where there is a script to run."""
    monkeypatch.setattr("wakewise.core.optional_dependencies.find_spec", lambda name: None if name == "lupa" else sys)
    assert SimulatedAutopilot(scripts={}).boot_ms == 0
    with pytest.raises(MissingExtra, match="lupa"):
        SimulatedAutopilot(scripts={"own.lua": "return"})
