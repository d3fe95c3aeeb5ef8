"""Failures and a cable that do not fit vehicle or route are refused before the flight; those that fit pass."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import load_vehicle
from wakewise.simulation.tank import TankSettings
from wakewise.simulation.tank.station_keeping import check_fit

VEHICLE = load_vehicle("paper")
ROUTE = [(0.0, Pose(np.array([0.0, 0.0, 1.0]))), (60.0, Pose(np.array([1.0, 0.0, 1.0])))]
CABLE = {"diameter_m": 0.005}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"failures": [{"thruster": 9}]}, r"failures\.0\.thruster: 9, paper has thrusters 1 to 8"),
        ({"failures": [{"thruster": 1, "at_s": 61.0}]}, r"at_s: 61 s, the flight takes 60 s"),
        (
            {"failures": [{"thruster": 8}, {"thruster": 1, "kind": "stuck", "value": 500.0}]},
            r"failures\.1\.value: stuck at 500 N, .* gives -40 to 51 N",
        ),
        ({"tether": CABLE | {"length_m": 3.0}}, r"tether\.length_m: 3, the route is 3\.64 m from the winch at 60 s"),
        (
            {"tether": CABLE | {"at_B_m": (0.0, 0.9, 0.0)}},
            r"\(0, 0\.9, 0\) m is not on the hull, .* 0\.225 x 0\.175 x 0\.14 m",
        ),
    ],
)
def test_what_does_not_fit_is_refused(fields, message):
    """A thruster that is not there, a failure after the end, a thrust beyond it, a cable too short or off the hull."""
    with pytest.raises(InputError, match=message):
        check_fit(TankSettings(**fields), VEHICLE, ROUTE)


@pytest.mark.parametrize(
    "fields",
    [
        {"failures": [{"thruster": 8, "kind": "stuck", "value": -40.0, "at_s": 60.0}]},
        {"tether": CABLE | {"length_m": 3.7, "at_B_m": (-0.3, 0.0, 0.0)}},
        {"tether": {"length_m": 0.1}},
    ],
)
def test_what_fits_passes(fields):
    """At the edges of what is allowed; without a diameter there is no cable whose length could matter."""
    settings = TankSettings(**fields)
    check_fit(settings, VEHICLE, ROUTE)
    assert settings.model_dump()
