"""The companion's watch against the stand-in: engage, drive, let go; each loss is in `test_beside_the_pilot.py`."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.core.errors import WakewiseError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import LOOP_MS, NEUTRAL_WITHIN_S
from wakewise_ardusub.sitl.companion_harness import CompanionHarness
from wakewise_ardusub.sitl.inprocess_session import InProcessSession

HEAVY = load_vehicle("bluerov2-heavy")


def test_all_well_and_the_operators_consent_put_thrusts_on_the_motors() -> None:
    """An autopilot that streams as slowly as out of the box is asked for more; 5 N are the pulses of the table."""
    aboard = CompanionHarness(InProcessSession(HEAVY)).engaged()
    assert aboard.gate.entry == 1
    pulses = aboard.flight.moments[-1].pulses_us[:8]
    assert len(set(pulses)) == 1
    assert 1560 < pulses[0] < 1620


def test_given_back_the_sticks_are_the_pilots() -> None:
    """The same press again; the motors do what the sticks say within 300 ms, armed as before."""
    aboard = CompanionHarness(InProcessSession(HEAVY)).engaged()
    aboard.flight.sticks = (500, 0, 500, 0)
    aboard.flight.run(0.2)
    assert "released" in aboard.gate.press()
    aboard.flight.run(NEUTRAL_WITHIN_S)
    assert aboard.flight.moments[-1].pulses_us[:8] == (1400, 1400, 1600, 1600, 1500, 1500, 1500, 1500)
    assert aboard.flight.autopilot.armed


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"scripts": {}}, "script"),
        ({"values": {"SCR_ENABLE": 0.0}}, "script"),
        ({"sticks": None, "values": {"FS_PILOT_INPUT": 0.0}}, "sticks of the pilot"),
    ],
)
def test_what_is_not_as_it_must_be_keeps_it_from_engaging(changed: dict[str, object], words: str) -> None:
    """No script, scripting off, no pilot: said, and no motor turns."""
    flight = InProcessSession(HEAVY, **changed)
    with pytest.raises(WakewiseError, match=words):
        CompanionHarness(flight).engaged()
    assert not any(moment.overridden for moment in flight.moments)


def test_six_motors_on_an_eight_motor_vehicle_keep_it_from_engaging() -> None:
    """As SERVOn_FUNCTION says, in words; and no motor turns."""
    flight = InProcessSession(HEAVY)
    for channel in (7, 8):
        flight.set(f"SERVO{channel}_FUNCTION", 0.0)
    with pytest.raises(WakewiseError, match="8 thrusters, the autopilot drives motors 1, 2, 3, 4, 5, 6;"):
        CompanionHarness(flight).engaged()
    assert not any(moment.overridden for moment in flight.moments)


def test_it_never_thrusts_while_disarmed() -> None:
    """Consent is refused; disarmed in flight, the script's next turn ends it: no thrust after two of its periods."""
    aboard = CompanionHarness(InProcessSession(HEAVY))
    aboard.flight.run(4.0)
    assert "disarmed" in aboard.gate.press()
    aboard = CompanionHarness(InProcessSession(HEAVY)).engaged()
    aboard.flight.arm(False)
    aboard.flight.run(1.0)
    disarmed_s = next(m.time_s for m in aboard.flight.moments if not m.armed and m.time_s > 2.0)
    assert not any(m.thrusting for m in aboard.flight.moments if m.time_s > disarmed_s + 2e-3 * LOOP_MS)
    assert not any(m.thrusting for m in aboard.flight.moments if not m.armed and m.time_s < disarmed_s)


def test_after_a_loss_it_engages_again_only_by_consent() -> None:
    """The sticks come back, a second later all is well, and nothing acts until the operator says so."""
    aboard = CompanionHarness(InProcessSession(HEAVY)).engaged()
    aboard.flight.sticks = None
    aboard.flight.run(0.5)
    aboard.flight.sticks = (0, 0, 500, 0)
    aboard.flight.run(3.0)
    assert not aboard.flight.moments[-1].overridden
    assert aboard.gate.press() == "engaged"
    aboard.flight.run(1.0)
    assert aboard.flight.moments[-1].overridden
