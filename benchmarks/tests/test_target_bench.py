"""Figures of the bench that judges how the camera finds its target."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise_benchmarks.target_finding import (
    consistent,
    coverage_figures,
    figures_of,
    holding,
    planned,
    planned_scan,
    wash_kept,
)

ROW = {
    "found_s": 6.0, "accepted_s": 19.0, "centre_first_mm": 12.0, "centre_after_orbit_mm": 4.0, "hold_rmse_mm": 1.0,
    "hold_mean_error_mm": 5.0,
    "hold_attitude_deg": 0.1, "hold_estimate_rmse_mm": 0.3, "lost_pct": 0.0, "energy_kJ": 1.0, "picture_ms_p99": 50.0,
    "nees_position": 2.0, "target_speed_mean_m_s": 0.01,
}  # fmt: skip


def test_wash_kept_is_the_share_of_the_known_regions_reduction() -> None:
    """Half the reduction of the known region is 50 %; a flight in which dp leaves little does not count."""
    speeds = {"found": 0.03, "known": 0.02, "dp": 0.04}
    rows = {("payload", arm, 1): {"target_speed_mean_m_s": v} for arm, v in speeds.items()}
    rows |= {("payload", arm, 2): {"target_speed_mean_m_s": 0.001} for arm in speeds}
    told = wash_kept(rows, "found")
    assert told["wash_pairs"] == 1
    assert told["wash_reduction_kept_pct"] == pytest.approx(50.0)
    assert wash_kept({}, "found") == {"wash_pairs": 0}


def test_a_failed_flight_found_nothing_and_a_late_one_is_not_in_time() -> None:
    """Found within ten seconds are those of all flights, failed ones included."""
    rows = {("still", "found", 1): ROW, ("still", "found", 2): ROW | {"found_s": 12.0}}
    told = figures_of(rows, failed=2)
    assert told["flights_of_found"] == 4
    assert told["found_pct"] == pytest.approx(25.0)
    assert told["hold_rmse_mm"] == pytest.approx(1.0)


def test_holding_leaves_the_mean_out_and_tells_it() -> None:
    """A constant offset is the mean error alone; motion about the mean is the hold's figure."""
    rows = np.zeros((100, 20))
    rows[:, 2] = 0.001 * np.sin(np.linspace(0.0, 20.0 * np.pi, 100, endpoint=False))
    rows[:, 8] = 0.02
    rows[:, 11:20] = 1e-6 * np.eye(3).ravel()
    told = holding(rows)
    assert told["hold_rmse_mm"] == pytest.approx(1.0 / np.sqrt(2.0), rel=0.01)
    assert told["hold_mean_error_mm"] == pytest.approx(20.0)
    assert told["hold_estimate_rmse_mm"] == pytest.approx(0.0, abs=1e-9)
    assert consistent([]) == (None, None)


def test_flights_are_told_apart_by_their_keys() -> None:
    """World, arm, seed and age of the region change a trial's key."""
    keys = {
        planned(world, arm, seed, more).task.key
        for world in ("payload", "still")
        for arm, more in (("found", {}), ("known", {"known_region": True}), ("found", {"latency_s": 0.3}))
        for seed in (4201, 4202)
    }
    assert len(keys) == 12


def test_coverage_is_told_of_each_kind_of_scan() -> None:
    """The bench's figure is that of whole scans; flights count for nothing, a scan without a model neither."""
    rows = {
        ("payload", "whole", 1): {"coverage_agreement_pct": 100.0, "rmse_mm": 1.0},
        ("payload", "whole", 2): {"coverage_agreement_pct": None},
        ("payload", "least-overlap", 1): {"coverage_agreement_pct": 70.0},
        ("payload", "found", 1): ROW,
    }
    told = coverage_figures(rows)
    assert told["coverage_agreement_pct"] == pytest.approx(100.0)
    assert [told["scans"][name]["scans"] for name in ("whole", "least-overlap")] == [2, 1]
    assert told["scans"]["least-overlap"]["coverage_agreement_pct"] == pytest.approx(70.0)
    assert told["scans"]["whole"]["rmse_mm"] == pytest.approx(1.0)
    assert coverage_figures({})["coverage_agreement_pct"] is None


def test_scans_fly_without_optical_tracking_and_find_their_target() -> None:
    """Both kinds differ in views alone, and each has a key of its own."""
    scans = [planned_scan(name, 4201).task for name in ("whole", "least-overlap")]
    fields = [dict(scan.settings["scenario"]) for scan in scans]
    assert scans[0].key != scans[1].key
    assert all(each["pilot"] == "find" and each["tank.sensors.tracking_rate_hz"] == 0.0 for each in fields)
    assert set(fields[1]) - set(fields[0]) == {"mission.elevations_deg", "mission.views", "find.further_views"}
