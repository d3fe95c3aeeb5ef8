"""The plant's own parameters."""

import math

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import compile_body, load_vehicle, perturbed, restoring_wrench


def test_nothing_perturbed_is_the_nominal_vehicle() -> None:
    nominal = load_vehicle("paper")
    same = perturbed(nominal, np.random.default_rng(0))
    assert same.mass_kg == nominal.mass_kg
    assert np.allclose(same.hydrodynamics.added_mass, nominal.hydrodynamics.added_mass, rtol=1e-15)
    assert np.array_equal(same.thrust_gains, np.ones(8))


@pytest.mark.parametrize("seed", range(20))
def test_every_parameter_stays_within_its_percentage_and_moves(seed: int) -> None:
    nominal = load_vehicle("bluerov2-heavy")
    plant = perturbed(
        nominal, np.random.default_rng(seed), mass_pct=5.0, damping_pct=30.0, added_mass_pct=20.0, thrust_pct=8.0
    )
    water, still = plant.hydrodynamics, nominal.hydrodynamics
    assert 0.0 < abs(plant.mass_kg / nominal.mass_kg - 1.0) <= 0.05
    for ours, theirs, share in (
        (np.diag(water.added_mass), np.diag(still.added_mass), 0.2),
        (np.diag(water.quadratic_damping), np.diag(still.quadratic_damping), 0.3),
        (plant.thrust_gains, nominal.thrust_gains, 0.08),
    ):
        off = np.abs(ours / theirs - 1.0)
        assert off.max() <= share + 1e-12
        assert off.min() > 0.0
    assert np.array_equal(plant.allocation_matrix, nominal.allocation_matrix)


@pytest.mark.parametrize("trim_N", [-3.0, 0.0, 1.5])
def test_trim_alone_shifts_the_buoyancy_whatever_the_mass_error(trim_N: float) -> None:
    plant = perturbed(
        load_vehicle("paper"),
        np.random.default_rng(4),
        mass_pct=10.0,
        trim_N=trim_N,
        water_density_kg_m3=1025.0,
        gravity_m_s2=9.8,
    )
    nominal = compile_body(load_vehicle("paper"), 1025.0, 9.8)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    shift = restoring_wrench(compile_body(plant, 1025.0, 9.8), level) - restoring_wrench(nominal, level)
    assert math.isclose(shift[2], -trim_N, abs_tol=1e-10)


def test_one_seed_gives_one_vehicle_however_much_is_perturbed() -> None:
    nominal = load_vehicle("paper")
    a = perturbed(nominal, np.random.default_rng(9), thrust_pct=5.0)
    b = perturbed(nominal, np.random.default_rng(9), thrust_pct=5.0, mass_pct=5.0, trim_N=1.0)
    assert np.array_equal(a.thrust_gains, b.thrust_gains)


@pytest.mark.parametrize(("changes", "words"), [({"mass_pct": -1.0}, "mass_pct"), ({"trim_N": -100.0}, "trim_N")])
def test_impossible_perturbations_are_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        perturbed(load_vehicle("paper"), np.random.default_rng(0), **changes)
