"""What the stand-in does when somebody falls silent."""

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD
from wakewise_ardusub.sitl.inprocess_session import InProcessSession
from wakewise_ardusub.sitl.own_parameters import ParameterTable
from wakewise_ardusub.sitl.simulated_autopilot import ground_station, pilot_input

HEAVY = load_vehicle("bluerov2-heavy")


def test_a_silent_ground_station_disarms_after_its_time_out() -> None:
    """Three seconds after the last heartbeat, said in words; the outputs are in the middle then."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).run(0.1)
    flight.arm(True)
    flight.run(1.0)
    flight.beats = False
    began_s = flight.now_s
    flight.run(3.5)
    disarmed_s = next(m.time_s for m in flight.moments if m.time_s > began_s and not m.armed)
    assert 2.0 <= disarmed_s - began_s <= 3.05
    assert not flight.moments[-1].thrusting
    assert any("Lost ground station" in text for text in flight.texts())


def test_it_may_hold_depth_instead() -> None:
    """FS_GCS_ENABLE of 3, as the parameter's documentation has it."""
    flight = InProcessSession(HEAVY, values={"FS_GCS_ENABLE": 3}).run(0.1)
    flight.arm(True)
    flight.run(1.0)
    flight.beats = False
    flight.run(3.5)
    assert flight.autopilot.armed
    assert flight.autopilot.mode == ALT_HOLD


def test_silent_sticks_go_to_the_middle_and_disarm() -> None:
    """They act on for FS_PILOT_TIMEOUT, as they do on the vehicle, and no longer."""
    flight = InProcessSession(HEAVY, sticks=(500, 0, 500, 0)).run(0.1)
    flight.arm(True)
    flight.run(1.0)
    flight.sticks = None
    flight.run(2.5)
    assert flight.moments[-1].thrusting
    flight.run(1.0)
    assert not flight.autopilot.armed
    assert not flight.moments[-1].thrusting


@pytest.mark.parametrize(
    ("value", "action"), [(0, "none"), (1, "warn"), (2, "disarm"), (3, "hold depth"), (4, "surface"), (9, "disarm")]
)
def test_the_parameters_values_mean_what_they_say(value: int, action: str) -> None:
    """A value that is none is taken for the safest."""
    table = ParameterTable({"FS_GCS_ENABLE": value, "FS_GCS_TIMEOUT": 3.0, "FS_PILOT_INPUT": min(value, 2)})
    assert ground_station(table, 1.0, 4.1) == action
    assert ground_station(table, 1.0, 3.9) == "none"
    assert ground_station(table, None, 100.0) == "none"
    assert pilot_input(table, None, 100.0) == ("none", "warn", "disarm")[min(value, 2)]
