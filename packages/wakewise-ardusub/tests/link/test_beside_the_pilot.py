"""Output gate and shipped script together against the stand-in: after any fault the outputs are the pilot's in time."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.protocol import NEUTRAL_WITHIN_S
from wakewise_ardusub.link.session_log import SessionLog, read_journal
from wakewise_ardusub.sitl.companion_harness import COMPANION_FAULTS, CompanionHarness
from wakewise_ardusub.sitl.inprocess_session import InProcessSession, noise

HEAVY = load_vehicle("bluerov2-heavy")
SLACK_S = 1e-6
WIDE = EngagementLimits(depth_m=(-1.0, 100.0), distance_m=100.0, tilt_rad=4.0, speed_m_s=10.0)
"""What constant thrusts do is no matter here."""


def aboard(journal: SessionLog | None = None, **flight) -> CompanionHarness:
    """An output gate beside the stand-in, at the pace of its own watch."""
    made = InProcessSession(HEAVY, loop_hz=50.0, **flight)
    return CompanionHarness(made, limits=WIDE, journal=journal, thrusts_N=np.tile([6.0, -6.0], 4))


@pytest.mark.parametrize("fault", COMPANION_FAULTS)
def test_after_a_fault_the_outputs_are_the_pilots(fault, tmp_path):
    """From the fault on no output is driven for longer than the bound; what ended it is in the journal."""
    journal = SessionLog(tmp_path / "journal.jsonl")
    companion = aboard(journal).engaged()
    flight = companion.flight
    assert flight.moments[-1].overridden
    at_s = flight.now_s
    COMPANION_FAULTS[fault](companion)
    flight.run(2.5)
    driven = [moment.time_s for moment in flight.moments if moment.overridden]
    assert max(driven) - at_s <= NEUTRAL_WITHIN_S + SLACK_S
    assert fault == "mode changed" or not flight.moments[-1].thrusting  # another mode holds depth by itself
    assert all(moment.armed for moment in flight.moments if moment.overridden)
    journal.close()
    lines, _ = read_journal(tmp_path / "journal.jsonl")
    ended = [line for line in lines if line["event"] == "state" and line["before"] == "engaged"]
    assert len(ended) == (fault != "the companion's program dies")


def test_the_pilots_own_sticks_act_before_and_after_and_not_between():
    """Sticks at half ahead: their outputs before consent and after release, the controller's while engaged."""
    companion = aboard(sticks=(500, 0, 500, 0)).engaged()
    flight = companion.flight
    before = next(moment for moment in flight.moments if moment.thrusting)
    between = flight.moments[-1]
    assert not before.overridden
    assert between.overridden
    assert between.pulses_us != before.pulses_us
    companion.gate.press()
    flight.run(0.3)
    after = flight.moments[-1]
    assert not after.overridden
    assert after.thrusting


def test_a_ground_station_that_is_lost_disarms_by_the_autopilots_own_failsafe():
    """The companion is no ground station: heartbeats and sticks stop, and the autopilot acts as it is set to."""
    companion = aboard().engaged()
    flight, at_s = companion.flight, companion.flight.now_s
    flight.beats, flight.sticks = False, None
    flight.run(6.0)
    assert max(m.time_s for m in flight.moments if m.overridden) - at_s <= NEUTRAL_WITHIN_S + SLACK_S
    assert companion.gate.entry is None
    assert "Lost ground station" in " ".join(flight.texts())


def test_a_million_bytes_of_noise_neither_crash_nor_drive_anything():
    """Noise on the companion's side, packets with right checksums among it: a disarmed vehicle stays still."""
    companion = aboard()
    flight = companion.flight.run(1.0)
    taken = 0
    for k, piece in enumerate(noise(1_000_000, seed=3)):
        companion.hear(piece)
        taken += len(piece)
        if k % 500 == 0:
            flight.run(0.02)
    flight.run(1.0)
    assert taken >= 1_000_000
    assert companion.gate.known.garbage > 0
    assert not companion.gate.thrusts_sent
    assert not any(moment.thrusting for moment in flight.moments)


def test_noise_while_engaged_does_no_harm():
    """A burst of it: the engagement ends if it says something alarming, else it goes on; nothing is driven disarmed."""
    companion = aboard().engaged()
    flight = companion.flight
    for piece in noise(20_000, seed=5):
        companion.hear(piece)
        flight.run(0.02)
    assert all(moment.armed for moment in flight.moments if moment.overridden)
    last_s = max(moment.time_s for moment in flight.moments if moment.overridden)
    assert companion.gate.entry is not None or last_s < flight.now_s
