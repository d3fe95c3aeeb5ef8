"""One flight of the gentle bench, really flown, and the float that a person adds."""

import math

import pytest

from wakewise.control.ballast_advice import net_buoyancy_N
from wakewise.core.interfaces import no_progress
from wakewise.experiments.campaigns.flights import fly_stage
from wakewise.operation.worlds.makers import true_vehicle
from wakewise.robot.vehicles.ballast import BallastBlock
from wakewise_paper.flights import with_true_blocks
from wakewise_paper.wash_reduction.flight import FIGURES, parts_of, wash_trial


@pytest.fixture(scope="module")
def row(tmp_path_factory):
    """The first seconds of braking towards the target, after settling."""
    trial = wash_trial("brake/bluerov2-heavy", "dp", 1, duration_s=10.0)
    return fly_stage(trial.task.settings, tmp_path_factory.mktemp("flight"), no_progress)


def test_a_flight_gives_every_figure(row):
    """Numbers that are finite; none for a rigid target, a float that nobody added, a shutter that did not open."""
    missing = {key for key in FIGURES if row.get(key) is None}
    assert missing <= {
        "sway_rms_mm",
        "sway_about_mean_mm",
        "sway_wash_mm",
        "float_N",
        *(key for key in FIGURES if "exposure" in key),
    }
    assert all(math.isfinite(row[key]) for key in set(FIGURES) - missing)
    assert row["energy_kJ"] > 0.0 and row["collisions"] == 0 and 0.0 <= row["exceedance_1cm_s_pct"] <= 100.0


def test_the_camera_is_off_by_about_what_the_body_is(row):
    """A camera 0.2 m from the body's origin adds its lever times the error of attitude, no more."""
    lever_mm = 1e3 * 0.25 * math.radians(row["attitude_rmse_deg"])
    assert abs(row["camera_rmse_mm"] - row["position_rmse_mm"]) <= lever_mm + 0.5


def test_a_float_changes_the_true_vehicle_alone():
    """True net buoyancy rises by the float; what is believed, and all that is drawn, stays."""
    parts = parts_of("orbit/paper", "dp", 1)
    light = with_true_blocks(parts, (BallastBlock(float_N=2.5),))
    before, after = true_vehicle(parts), light.world.vehicle
    assert net_buoyancy_N(after) - net_buoyancy_N(before) == pytest.approx(2.5)
    assert after.mass_kg > before.mass_kg  # foam weighs, too
    assert light.vehicle.displaced_volume_m3 == parts.vehicle.displaced_volume_m3
    assert light.external_parts == parts.external_parts
