"""Figures: complete, in order, never silently missing; comparisons are ratios to the first."""

import json

import pytest

from wakewise.experiments.trials.metrics import BETTER, DEFINITIONS, UNITS, MetricsCollector, comparison

# The keys that every scan promises to machines that read its JSON.
PROMISED = [
    "rmse_mm",
    "rmse_cap_mm",
    "accuracy_median_mm",
    "completeness_pct",
    "completeness_visible_pct",
    "completeness_1mm_pct",
    "completeness_2mm_pct",
    "f_score",
    "features_per_image",
    "inlier_matches",
    "registered_images",
    "images",
    "success",
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "bed_speed_p95_m_s",
    "turbidity_mean_per_m",
    "disturbance",
    "position_rmse_mm",
    "path_rmse_mm",
    "velocity_deviation_pct",
    "roll_pitch_rms_deg",
    "energy_kJ",
    "sign_flips_per_s",
    "duration_s",
    "solve_ms_median",
    "solve_ms_p99",
    "fallbacks",
    "collisions",
    "wall_s",
    "cpu_s",
    "seed",
    "method",
]


def test_every_promised_figure_is_there_with_unit_and_definition() -> None:
    """Even with nothing computed all keys are present, null, and say why."""
    result = MetricsCollector().finish()
    for key in PROMISED:
        assert result[key] is None
        assert result["why"][key]
        assert key in UNITS
        assert DEFINITIONS[key]
    json.dumps(result, allow_nan=False)


def test_a_figure_that_is_there_needs_no_excuse_and_one_that_failed_keeps_its_reason() -> None:
    """Reasons stand beside null figures only."""
    gathering = MetricsCollector()
    gathering.add({"rmse_mm": 1.25, "success": False, "fallbacks": 0})
    gathering.missing(("rmse_mm", "f_score"), "no model: 3 of 48 photographs registered")
    result = gathering.finish()
    assert result["rmse_mm"] == 1.25
    assert "rmse_mm" not in result["why"]
    assert result["why"]["f_score"].startswith("no model")
    assert result["success"] is False
    assert result["fallbacks"] == 0


def test_ratios_are_to_the_first_method_and_never_a_division_by_nothing() -> None:
    """The first method's ratios are 1; a missing or zero base gives null with a reason."""
    figures = {
        "dp": {"target_speed_mean_m_s": 0.02, "energy_kJ": 2.0, "disturbance_flown": 0.0, "rmse_mm": None},
        "wake-aware": {"target_speed_mean_m_s": 0.01, "energy_kJ": 3.0, "disturbance_flown": 0.0, "rmse_mm": 1.0},
    }
    ratios = comparison(figures)["ratios"]
    assert ratios["dp"]["target_speed"] == 1.0
    assert ratios["wake-aware"]["target_speed"] == pytest.approx(0.5)
    assert ratios["wake-aware"]["energy"] == pytest.approx(1.5)
    assert ratios["wake-aware"]["disturbance_flown"] is None
    assert "zero" in ratios["wake-aware"]["why"]["disturbance_flown"]
    assert "missing" in ratios["wake-aware"]["why"]["rmse"]


def test_no_ratio_is_made_of_what_cannot_be_compared() -> None:
    """A figure whose definition says that methods cannot be compared by it is in no ratio, and has no better side."""
    alone = {key for key, text in DEFINITIONS.items() if "cannot be compared by it" in text}
    assert alone == {"disturbance"}
    both = dict.fromkeys(UNITS, 1.0)
    made = comparison({"dp": both, "ours": both})["ratios"]["ours"]
    assert "disturbance_flown" in made and not alone & set(made)
    assert {BETTER[key] for key in alone} == {"none"}
