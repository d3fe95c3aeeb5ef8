"""A flight in the lattice: a vehicle that hovers moves its water, leaves what it cannot, and is told so."""

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.operation.worlds.lattice_world import LatticeWater, solid_cells

STILL = {"world": "still-tank", "flow": "lattice", "method": "dp", "tank.mismatch.trim_N": -4.0}


@pytest.fixture(scope="module")
def flown():
    """Two seconds of holding a heavy vehicle up, in coarse water."""
    parts = ww.Scenario.preset("quick", **STILL).parts()
    start = parts.start
    water = LatticeWater(
        parts.world.vehicle, parts.target, parts.scenario.tank, start, np.random.default_rng(0), 1.3, 0.05
    )
    up = np.where(np.abs(parts.vehicle.thruster_axes_B[:, 2]) > 0.5, -1.5, 0.0)
    for _ in range(100):
        water.step(up, 0.02)
    return parts, water


@pytest.mark.slow
def test_what_holds_the_vehicle_up_goes_down_in_the_water(flown):
    """The water's momentum is downwards and no more than the jets gave it; sideways there is next to none."""
    parts, water = flown
    box, density_kg_m3 = water.box, parts.scenario.tank.density_kg_m3
    momentum = box.field_m_s().astype(np.float64).sum((1, 2, 3)) * density_kg_m3 * box.cell_m**3
    given = 4 * 1.5 * 2.0
    assert 0.3 * given < momentum[2] < given
    assert water.water().target_speed_mean_m_s >= 0.0 and water.observe().power_W > 0.0


@pytest.mark.slow
def test_in_a_current_only_what_the_vehicle_adds_is_excess():
    """Before anything is pushed there is none in a current that has not settled, and the current is the ambient one."""
    told = {**STILL, "tank.current.velocity_m_s": [0.1, 0.0, 0.0]}
    parts = ww.Scenario.preset("quick", **told).parts()
    water = LatticeWater(
        parts.world.vehicle, parts.target, parts.scenario.tank, parts.start, np.random.default_rng(0), 1.3, 0.1
    )
    first = water.water()
    water.step(np.full(8, 2.0), 0.3)
    assert first.target_speed_mean_m_s == 0.0 < water.water().target_speed_mean_m_s
    far = parts.start.X_WB.p_m + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.3]])
    added = np.linalg.norm(water.excess_velocity(far), axis=1)
    assert np.all((added > 0.0) & (added < 1.0)) and np.all(np.linalg.norm(water.box.velocity(far), axis=1) > 0.05)
    assert water.water().target_speed_mean_m_s < 0.1


@pytest.mark.slow
def test_the_target_is_solid_where_it_stands(flown):
    """Cells on its surface are, far ones are not, and the count is that of its size."""
    parts, _ = flown
    low = np.array([-0.5, -0.5, 0.5])
    solid = solid_cells(parts.target, low, (50, 50, 50), 0.02)
    at = ((parts.target.mesh.vertices_m[::50] - low) / 0.02).astype(int)
    near = [
        solid[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2, max(k - 1, 0) : k + 2].any() for i, j, k in at if k < 50
    ]
    assert np.mean(near) > 0.9 and not solid[:5].any() and 0 < solid.sum() < 0.2 * solid.size


def test_water_that_the_lattice_has_not_is_refused():
    """Waves, a pump, a cable: one line each that says what to do."""
    for field in ("tank.waves.amplitude_m", "tank.pump.speed_m_s", "tank.tether.diameter_m"):
        parts = ww.Scenario.preset("quick", **STILL, **{field: 0.004}).parts()
        with pytest.raises(InputError, match=f"{field}: the lattice has no .*; take flow tank"):
            parts.world.begin()
