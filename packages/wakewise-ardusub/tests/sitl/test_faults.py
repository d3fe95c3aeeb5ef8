"""Faults while thrusts are streamed: the outputs are the autopilot's again within 300 ms, and noise moves nothing.

The companion here is a mere stream, so this is what script and autopilot see to without its help.
"""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ENABLE_PARAMETER, LOOP_MS, NEUTRAL_WITHIN_S, STABILIZE
from wakewise_ardusub.sitl.inprocess_session import FAULTS, THRUSTS, InProcessSession, MavlinkSender, noise, run_fault

HEAVY = load_vehicle("bluerov2-heavy")
ACTING = tuple(int(1500 + 400 * value + 0.5) for value in THRUSTS)


def test_engaged_the_companions_thrusts_are_on_the_motors() -> None:
    """As 1500 + 400 v us, and the script says that it acts."""
    flight = InProcessSession(HEAVY).engaged()
    assert flight.moments[-1].pulses_us[:8] == ACTING
    assert "Wakewise: acting" in flight.texts()


@pytest.mark.parametrize("fault", FAULTS)
def test_after_a_fault_the_outputs_are_the_autopilots_within_300_ms(fault: str) -> None:
    """Each of them, by the script's time-out or at once."""
    after = run_fault(HEAVY, FAULTS[fault])
    assert after.neutral_ms <= 1e3 * NEUTRAL_WITHIN_S
    assert after.disarmed_thrusts == 0


def test_the_pilot_has_the_sticks_after_the_stream_stops() -> None:
    """Not only is the override over: the motors do what the sticks say."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).engaged()
    flight.streams = False
    flight.run(NEUTRAL_WITHIN_S)
    assert flight.moments[-1].pulses_us[:8] == (1400, 1400, 1600, 1600, 1500, 1500, 1500, 1500)


def test_a_lost_ground_station_ends_thrusts_although_they_are_streamed() -> None:
    """The autopilot disarms after its time-out, and the script lets go at once."""
    flight = InProcessSession(HEAVY).engaged()
    flight.beats = False
    flight.run(4.0)
    assert not flight.autopilot.armed
    disarmed_s = next(m.time_s for m in flight.moments if not m.armed and m.time_s > 2.0)
    assert flight.last_override_s() <= disarmed_s + 0.03


def test_no_thrust_while_disarmed_whatever_is_streamed() -> None:
    """Streaming before arming with the switch on, never; after disarming, none beyond two turns of the script."""
    flight = InProcessSession(HEAVY).run(0.2)
    flight.set(ENABLE_PARAMETER, 1.0)
    flight.streams = True
    flight.run(1.0)
    flight.arm(True)
    flight.run(0.5)
    assert flight.moments[-1].thrusting
    flight.arm(False)
    flight.run(2.0)
    ended_s = next(m.time_s for m in flight.moments if not m.armed and m.time_s > 1.5)
    assert not any(m.thrusting for m in flight.moments if m.time_s <= 1.2)
    assert not any(m.thrusting for m in flight.moments if m.time_s > ended_s + 2e-3 * LOOP_MS)


def test_others_than_the_companion_drive_nothing() -> None:
    """Another component, another system, the ground station: refused, and the companion's own go on."""
    flight = InProcessSession(HEAVY).engaged()
    strangers = [
        MavlinkSender(flight.autopilot.hear, system, component, f"{system} {component}")
        for system, component in ((1, 190), (2, 191), (255, 190), (1, 1))
    ]
    flight.each = lambda now: [now.send_thrusts((0.9,) * 8, who=who) for who in strangers]
    flight.run(1.0)
    assert flight.moments[-1].pulses_us[:8] == ACTING
    flight.streams = False
    flight.run(0.5)
    assert not flight.moments[-1].thrusting


def test_the_switch_is_off_after_a_start() -> None:
    """So a companion that streams into a vehicle that was started anew moves nothing, armed or not."""
    flight = InProcessSession(HEAVY, streams=True).run(0.2)
    flight.arm(True)
    flight.run(1.0)
    assert not any(m.overridden for m in flight.moments)


def test_stabilize_is_allowed_and_its_loops_do_not_fight() -> None:
    """The override stands over what the loops ask for."""
    flight = InProcessSession(HEAVY).run(0.1)
    flight.set_mode(STABILIZE)
    flight.engaged()
    assert flight.moments[-1].pulses_us[:8] == ACTING


def test_a_million_bytes_of_noise_crash_nothing_and_turn_no_motor() -> None:
    """Disarmed; a third of them are packets of random content whose checksum is right."""
    flight = InProcessSession(HEAVY).run(0.1)
    heard = 0
    for k, piece in enumerate(noise(1_000_000, 7)):
        flight.autopilot.hear(piece, "noise")
        heard += len(piece)
        if k % 20 == 0:
            flight.run(0.01)
    assert heard >= 1_000_000
    assert flight.autopilot.bad_data > 1000
    assert not any(moment.thrusting for moment in flight.moments)
    assert flight.autopilot.script_faults == []
    flight.engaged()
    assert flight.moments[-1].overridden


def test_noise_beside_an_engaged_companion_leaves_it_safe() -> None:
    """Whatever it does to the stream, the stream's end is the end within 300 ms."""
    flight = InProcessSession(HEAVY).engaged()
    pieces = iter(noise(100_000, 8))
    flight.each = lambda now: [now.autopilot.hear(piece, "noise") for piece in [next(pieces, b"")] * 1]
    flight.run(4.0)
    flight.streams, flight.each = False, None
    began_s = flight.now_s
    flight.run(1.0)
    last_s = flight.last_override_s() or 0.0
    assert last_s - began_s <= NEUTRAL_WITHIN_S
    assert flight.autopilot.script_faults == []
