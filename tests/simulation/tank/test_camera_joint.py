"""The simulated camera's joint and its encoder."""

import math

import numpy as np
import pytest

import wakewise as ww
from wakewise.robot.vehicles.vehicle import TiltJoint
from wakewise.simulation.tank import Sensors
from wakewise.simulation.tank.sensors import CameraJoint
from wakewise.simulation.tank.settings import SensorSettings

JOINT = TiltJoint(low_rad=-0.8, high_rad=0.8, rate_rad_s=1.0)


def camera(seed=0, joint=JOINT, start=0.0, **sensors):
    return CameraJoint(joint, start, SensorSettings(**sensors), np.random.default_rng(seed))


@pytest.mark.parametrize("world", ["tank", "paper"])
def test_the_joints_draws_do_not_depend_on_how_many_sensors_there_are(world, monkeypatch) -> None:
    """A sensor that takes one more stream, as docs/extending.md says, leaves bias and noise of the joint alone."""
    scenario = ww.Scenario.preset("quick", method="dp", world=world, **{"target.points": 60})
    before = scenario.parts().world.begin()[0]._joint._bias_rad
    whole = Sensors.__init__

    def more(self, settings, rng):
        whole(self, settings, rng)
        rng.spawn(1)

    monkeypatch.setattr(Sensors, "__init__", more)
    assert scenario.parts().world.begin()[0]._joint._bias_rad == before


def test_the_joint_turns_at_its_rate_to_the_desired_angle_or_its_stop() -> None:
    """0.02 rad in a fiftieth of a second, and no farther than the stop."""
    one = camera()
    one.aim(-2.0)
    tilts = []
    for k in range(60):
        one.turn(0.02 * (k + 1), 0.02)
        tilts.append(one.tilt_rad)
    assert tilts[:3] == pytest.approx([-0.02, -0.04, -0.06])
    assert np.abs(np.diff(tilts)).max() <= 0.02 + 1e-12
    assert tilts[-1] == -0.8


def test_the_encoder_errs_as_it_is_said_to() -> None:
    """A constant error per trial and a noise per reading, of the stated sizes; none of either when both are 0."""
    biases, noises = [], []
    for seed in range(300):
        one = camera(seed)
        reads = np.array([one.turn(0.02 * k, 0.02)[0].tilt_rad for k in range(50)])
        biases.append(reads.mean())
        noises.append(reads.std(ddof=1))
    assert np.std(biases) == pytest.approx(0.005, rel=0.12)  # three sigma of 300 draws
    assert np.mean(noises) == pytest.approx(0.002, rel=0.05)
    exact = camera(start=0.3, tilt_bias_rad=0.0, tilt_noise_rad=0.0)
    assert exact.turn(0.02, 0.02)[0].tilt_rad == 0.3


def test_a_fixed_camera_measures_nothing() -> None:
    """And stands at zero whatever is desired."""
    fixed = camera(joint=None, start=0.4)
    fixed.aim(0.5)
    assert fixed.turn(1.0, 1.0) == ()
    assert fixed.tilt_rad == 0.0


def test_an_angle_that_is_no_number_is_not_followed() -> None:
    """The joint goes on to where it was last told."""
    one = camera()
    one.aim(0.1)
    one.aim(math.nan)
    one.turn(1.0, 1.0)
    assert one.tilt_rad == pytest.approx(0.1)
