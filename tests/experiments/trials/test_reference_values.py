"""What a flight's figures are held against is computed from the same flight, and says why where it cannot be."""

import numpy as np
import polars as pl
import pytest

from wakewise.control import vehicle_layout
from wakewise.core.geometry import Pose, look_at
from wakewise.experiments.trials.metrics import (
    BETTER,
    DEFINITIONS,
    UNITS,
    MetricsCollector,
    add_reference_values,
    allocation_figures,
    ambient_speed_m_s,
    grain_threshold_Pa,
)
from wakewise.operation import Parts, load_scenario


@pytest.fixture(scope="module")
def parts() -> Parts:
    return load_scenario("quick", None, {"world": "tank", "target.kind": "brain", "target.points": 60}).parts()


def steps_with(parts: Parts, thrusts_N: np.ndarray) -> pl.DataFrame:
    """A hover of ten steps half a metre north of the target, camera towards it, with the same commands throughout."""
    centre = parts.target.centre_W_m
    place = centre + np.array([0.5, 0.0, -0.3])
    X_WB = Pose.from_matrix(look_at(place, centre), place)
    columns = {"time_s": 0.1 * np.arange(10)}
    columns |= {f"est_{a}_m": np.full(10, X_WB.p_m[i]) for i, a in enumerate("xyz")}
    columns |= {f"est_q{a}": np.full(10, X_WB.q[i]) for i, a in enumerate("wxyz")}
    columns |= {f"command_{i + 1}_N": np.full(10, T) for i, T in enumerate(thrusts_N)}
    return pl.DataFrame(columns)


def test_least_thrusts_are_held_against_themselves_and_spare_ones_are_not(parts: Parts) -> None:
    """Flown as `dp` would, both figures are one; thrusts that fight each other change what was flown, not the other."""
    layout = vehicle_layout(parts.vehicle)
    least = layout.inverse @ np.array([3.0, -2.0, 4.0, 0.0, 0.0, 0.5])
    same = allocation_figures(parts, steps_with(parts, least))
    assert same["disturbance_flown"] == pytest.approx(same["disturbance_least_thrusts"], rel=1e-9)
    assert same["disturbance_flown"] > 0.0
    fight = np.linalg.svd(layout.B)[2][-1]
    other = allocation_figures(parts, steps_with(parts, least + 2.0 * fight))
    assert other["disturbance_least_thrusts"] == pytest.approx(same["disturbance_least_thrusts"], rel=1e-6)
    assert abs(other["disturbance_flown"] / same["disturbance_flown"] - 1.0) > 0.01


@pytest.mark.slow
def test_the_waters_own_speed_is_that_of_its_current(parts: Parts) -> None:
    """A steady current has its own speed, still water has none."""
    times = np.linspace(0.0, 60.0, 50)
    assert ambient_speed_m_s(parts, times) == pytest.approx(np.hypot(0.03, 0.02), rel=1e-9)
    still = load_scenario("quick", None, {"world": "tank", "tank.current.velocity_m_s": [0, 0, 0]})
    assert ambient_speed_m_s(still.parts(), times) == 0.0


def test_grains_move_at_the_stress_that_the_tank_takes(parts: Parts) -> None:
    """Soulsby's threshold of 20 um of calcite is 0.063 Pa; a stated one goes first; a clean bed has none."""
    assert grain_threshold_Pa(parts.scenario.tank) == pytest.approx(0.063, abs=0.001)
    assert grain_threshold_Pa(load_scenario("quick", None, {"tank.silt.threshold_Pa": 0.2}).tank) == 0.2
    assert grain_threshold_Pa(load_scenario("quick", None, {"tank.silt.kind": "clear"}).tank) is None


def test_what_cannot_be_computed_says_why(parts: Parts) -> None:
    """Without commands no sharing, without grains no threshold; the water's own speed is there all the same."""
    clear = load_scenario("quick", None, {"tank.silt.kind": "clear"})
    gathering = MetricsCollector()
    add_reference_values(gathering, clear.parts(), pl.DataFrame({"time_s": [0.0, 1.0]}))
    result = gathering.finish()
    assert result["ambient_speed_m_s"] > 0.0
    assert "command_1_N" in result["why"]["disturbance_flown"]
    assert "grains" in result["why"]["grain_threshold_Pa"]


def test_every_figure_says_which_side_is_better() -> None:
    """Unit, definition and direction stand in one place, for every key of metrics.json."""
    assert BETTER.keys() == UNITS.keys() == DEFINITIONS.keys()
    assert set(BETTER.values()) == {"less", "more", "none"}
    assert (BETTER["bed_shear_p95_Pa"], BETTER["f_score"], BETTER["seed"]) == ("less", "more", "none")
