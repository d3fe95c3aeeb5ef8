"""What takes thrust away: failures at their time, and inflow by the linear law."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.simulation.tank import ThrusterFailure
from wakewise.simulation.tank.plant import ADVANCE_OF_NO_THRUST, KT_STILL, FailingThrusters, inflow_factors

WANTED = np.array([1.0, -2.0, 3.0])
MOTORS = np.array([0.5, 0.6, 0.7])


def _wanted(time_s, *failures):
    return FailingThrusters(failures, 3).wanted(time_s, WANTED, MOTORS).tolist()


def test_failures_begin_at_their_time():
    """Before it all is well; from it on a dead thruster wants nothing, a weak one its share, a stuck one its value."""
    dead = ThrusterFailure(thruster=1, at_s=5.0)
    half = ThrusterFailure(thruster=2, at_s=5.0, kind="half")
    quarter = ThrusterFailure(thruster=2, kind="half", value=0.25)
    stuck = ThrusterFailure(thruster=3, kind="stuck", value=-4.0)
    assert _wanted(4.9, dead, half) == WANTED.tolist()
    assert _wanted(5.0, dead, half) == [0.0, -1.0, 3.0]
    assert _wanted(0.0, quarter, stuck) == [1.0, -0.5, -4.0]


def test_a_thruster_that_sticks_keeps_what_it_had():
    """Without a value it stays at the thrust of the instant it failed, whatever comes."""
    failing = FailingThrusters((ThrusterFailure(thruster=1, kind="stuck", at_s=1.0),), 3)
    assert failing.wanted(1.0, WANTED, MOTORS)[0] == 0.5
    assert failing.wanted(2.0, WANTED, 9 * MOTORS)[0] == 0.5


def test_bad_failures_are_refused():
    """A thruster that is not there, a share above one, and a value for a dead one."""
    with pytest.raises(InputError, match="thruster 4, the vehicle has 3"):
        FailingThrusters((ThrusterFailure(thruster=4),), 3)
    for bad in ({"thruster": 0}, {"thruster": 1, "kind": "half", "value": 2.0}, {"thruster": 1, "value": 1.0}):
        with pytest.raises(ValidationError):
            ThrusterFailure(**bad)


def test_inflow_takes_thrust_by_the_line():
    """None at rest, half at half the speed of no thrust, all at that speed; against the jet a little more thrust."""
    area, thrust, density = 0.25 * np.pi * 0.06**2, 4.0, 1000.0
    revolutions = np.sqrt(thrust / (density * 0.06**4 * KT_STILL))
    still = ADVANCE_OF_NO_THRUST * revolutions * 0.06
    speeds = np.array([0.0, 0.5, 1.0, 2.0, -0.1, -5.0]) * still
    factors = inflow_factors(np.full(6, -thrust), speeds, np.full(6, area), density)
    assert factors == pytest.approx([1.0, 0.5, 0.0, 0.0, 1.1, 1.2])
    assert inflow_factors(np.zeros(1), np.ones(1), np.full(1, area), density).tolist() == [1.0]
