"""A tank's water is what its settings say."""

import numpy as np

from wakewise.operation import Scenario
from wakewise.simulation.tank.ambient import tank_water
from wakewise.simulation.tank.tank import tank_ambient


def test_jets_are_as_wide_as_the_settings_say():
    """The same jet for five seconds: half a metre down its axis the widest that worlds draw is the slowest, by what its
    width makes of its momentum; the bed lies where the tank ends.
    """
    speeds = []
    for growth in (0.094, 0.18):
        told = {"world": "tank", "tank.jets.half_width_growth": growth, "tank.jets.turbulence": 0.0}
        world = Scenario.preset("quick", **told).parts().world
        ambient = tank_ambient(world.settings, world.draw())
        water = tank_water(world.vehicle, world.target, world.settings, ambient, np.random.default_rng(0))
        count = len(world.vehicle.thrusters)
        # All disks in one place far from target and bed; the first blows north.
        disks, axes = np.tile([-1.0, -1.0, 0.5], (count, 1)), np.tile([-1.0, 0.0, 0.0], (count, 1))
        impulses = 0.05 * np.stack([np.eye(count)[0], np.zeros(count)], axis=1)
        for _ in range(100):
            water.step(0.05, disks, disks, axes, impulses)
        assert water.bed_z_m == world.settings.size_m[2]
        speeds.append(float(water.excess_velocity(np.array([[-0.5, -1.0, 0.5]]))[0, 0]))
    assert 0.0 < speeds[1] < 0.7 * speeds[0]
