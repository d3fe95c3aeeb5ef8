"""Trim from a flight's record: in the tank, and what is no hover."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.operation.flight_trim import ballast_proposal, flight_trim, folder_trim, hover_mask
from wakewise.robot.vehicles import compile_body, load_vehicle, restoring_wrench
from wakewise.robot.vehicles.ballast import BallastBlock, net_buoyancy_N, with_blocks
from wakewise.scene.targets import Region

TWIST = ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")
WATER = {"target.points": 60, "tank.mismatch.trim_N": 0.0}
FEW_POINTS = Region(
    points_W_m=np.array([[0.0, 0.0, 1.4], [0.05, 0.0, 1.35]]), weights=np.ones(2), distance_m=np.zeros(2)
)
"""Weights are found wherever the water is asked about: no region has to be sampled for them."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "load"),
    [
        (1, BallastBlock(float_N=-3.4)),
        (2, BallastBlock(float_N=-2.0, at_B_m=(0.15, 0.0, 0.0))),
        (3, BallastBlock(float_N=2.4, at_B_m=(-0.1, 0.1, 0.0))),
    ],
)
def test_seven_seconds_of_hover_say_what_nobody_knew(seed: int, load: BallastBlock) -> None:
    """In the tank, with drawn drag and gains: weight within .3 N, and the advice cancels load and turn."""
    parts = ww.Scenario.preset("quick", method="dp", seed=seed, **WATER).parts().replace(region=FEW_POINTS)
    laden = with_blocks(parts.world.vehicle, [load])
    flight = ww.fly(parts.replace(world=replace(parts.world, vehicle=laden)), duration_s=7.0, water_every_s=np.inf)
    found = flight_trim(parts.vehicle, flight.steps)
    true_N = net_buoyancy_N(parts.vehicle) - net_buoyancy_N(laden)
    assert found.heavy_N == pytest.approx(true_N, abs=0.3)
    assert abs(found.heavy_N - true_N) < 3.0 * found.weight_std_N
    trimmed = with_blocks(laden, found.blocks)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    left = restoring_wrench(compile_body(trimmed), level) - restoring_wrench(compile_body(parts.vehicle), level)
    assert -0.5 - 0.3 < left[2] < 0.3  # neutral to half a newton light
    # Half a step of place, 2.5 cm of 3.4 N, and half a step of weight at 15 cm.
    assert np.all(np.abs(left[3:5]) < 0.12)


def still(seconds: float, weight_N: float = 3.0, n: int = 8) -> pl.DataFrame:
    """A record of a level hover, with a load."""
    rows = round(50 * seconds)
    zero = [
        f"{who}_{name}"
        for who in ("est", "goal")
        for name in ["u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s"]
    ]
    columns = dict.fromkeys([*zero, "est_qx", "est_qy", "est_qz"], 0.0) | {"est_qw": 1.0, "load_Z_N": weight_N}
    columns |= dict.fromkeys(["load_X_N", "load_Y_N", "load_K_Nm", "load_M_Nm", "load_N_Nm"], 0.0)
    columns |= {f"command_{i + 1}_N": 0.1 for i in range(n)}
    return pl.DataFrame({"time_s": np.arange(rows) / 50.0, **{k: np.full(rows, v) for k, v in columns.items()}})


def test_a_hover_is_a_goal_at_rest_and_a_vehicle_that_is() -> None:
    """After four seconds, while goal and vehicle stand."""
    steps = still(8.0)
    assert hover_mask(steps).sum() == 200
    moves = steps.with_columns(goal_u_m_s=pl.when(pl.col("time_s") > 6.0).then(0.05).otherwise(0.0))
    assert hover_mask(moves).sum() == 101
    swings = steps.with_columns(est_q_rad_s=pl.when(pl.col("time_s") > 6.0).then(0.1).otherwise(0.0))
    assert hover_mask(swings).sum() == 101


def test_a_flight_says_one_line_where_a_block_is_worth_it() -> None:
    """Three newtons: what, where, how sure. A fifth of a newton: nothing."""
    vehicle = load_vehicle("paper")
    said = ballast_proposal(vehicle, still(8.0))
    assert said is not None and said.startswith("add 3.0 N of float in the middle (it is 3.0 +- 0.0 N heavy")
    assert ballast_proposal(vehicle, still(8.0, 0.2)) is None
    assert ballast_proposal(vehicle, still(5.0)) is None


def test_the_settling_hover_says_the_ballast_before_the_first_leg(caplog) -> None:
    """A vehicle four newtons heavy is told so once, as soon as the hover ends; one that is trimmed is not."""
    for trim_N, lines in ((-4.0, 1), (0.2, 0)):
        caplog.clear()
        told = {"tank.mismatch.trim_N": trim_N, "mission.settle_s": 8.0, "tank.current.velocity_m_s": (0.0, 0.0, 0.0)}
        parts = ww.Scenario.preset("quick", method="dp", world="tank", **told).parts().replace(region=FEW_POINTS)
        ww.fly(parts, duration_s=8.5, water_every_s=60.0)
        said = [record.message for record in caplog.records if "settling hover" in record.message]
        assert len(said) == lines
        assert all("N of float" in words and "N heavy" in words for words in said)


def test_what_says_nothing_of_trim_is_refused(tmp_path) -> None:
    """A flight too short, a record without loads, a folder that is no trial's."""
    vehicle = load_vehicle("paper")
    with pytest.raises(InputError, match=r"1\.0 s of hover"):
        flight_trim(vehicle, still(5.0))
    with pytest.raises(InputError, match="no column load_X_N"):
        flight_trim(vehicle, still(8.0).drop("load_X_N"))
    with pytest.raises(InputError, match="not the folder of a trial"):
        folder_trim(tmp_path)


def test_ballast_is_everybodys() -> None:
    """Believed and true vehicle get the same blocks; the mismatch stays what it was."""
    plain = ww.Scenario.preset("quick", **WATER)
    laden = plain.replace(ballast=[{"float_N": 2.0, "at_B_m": [0.1, 0.0, 0.0]}])
    assert laden.ballast == (BallastBlock(float_N=2.0, at_B_m=(0.1, 0.0, 0.0)),)
    believed, true = ((s.parts().vehicle, s.parts().world.vehicle) for s in (plain, laden))
    for before, after in zip(believed, true, strict=True):
        assert net_buoyancy_N(after) - net_buoyancy_N(before) == pytest.approx(2.0, abs=0.02)
        assert after.p_BB_m[0] > before.p_BB_m[0]


def test_a_vehicle_given_in_python_has_its_ballast_on() -> None:
    """Blocks of the scenario would be left off in silence, so they are refused."""
    scenario = ww.Scenario.preset("quick", ballast=[{"float_N": 1.0}])
    with pytest.raises(InputError, match="ballast"):
        scenario.parts().replace(vehicle=load_vehicle("paper"))
