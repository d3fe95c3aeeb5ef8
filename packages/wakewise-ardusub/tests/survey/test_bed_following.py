"""The bed from a late and noisy rangefinder, and the depth that follows it."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise_ardusub.survey.bed_following import LONGEST_S, BedTrack, DepthShaper


def tracked(depths: np.ndarray, every_s: float = 0.1) -> BedTrack:
    track = BedTrack()
    for k, depth in enumerate(depths):
        track = track.take(every_s * k, float(depth))
    return track


def test_a_constant_slope_is_carried_on_to_the_present() -> None:
    """A bed that rises by 3 cm/s, measured 0.3 s ago with 1 cm of noise, is known within 2 cm, its rate in 2 cm/s."""
    rng = np.random.default_rng(0)
    times = 0.1 * np.arange(40)
    track = tracked(5.0 - 0.03 * times + 0.01 * rng.normal(size=40))
    depth, rate = track.bed(float(times[-1]) + 0.3)
    assert depth == pytest.approx(5.0 - 0.03 * (times[-1] + 0.3), abs=0.02)
    assert rate == pytest.approx(-0.03, abs=0.02)


def test_an_outlier_is_refused_and_a_step_is_believed_after_four_values() -> None:
    """One value of 9 m among those of 5 m changes nothing; four of 4 m that agree are the bed."""
    track = tracked(np.full(20, 5.0)).take(2.0, 9.0)
    assert track.bed(2.0)[0] == pytest.approx(5.0)
    assert track.outliers == 1
    for k in range(4):
        track = track.take(2.1 + 0.1 * k, 4.0)
    assert track.bed(2.4)[0] == pytest.approx(4.0)


def test_in_a_drop_out_the_slope_fades_and_then_nothing_is_known() -> None:
    """After 5 s without a value there is no bed; until then the line goes on by two seconds of its slope at most."""
    track = tracked(5.0 - 0.01 * np.arange(20))
    last = 5.0 - 0.19
    assert track.bed(1.9 + 4.0)[0] == pytest.approx(last - 0.2, abs=0.02)
    assert track.bed(1.9 + LONGEST_S + 0.1) is None
    assert BedTrack().bed(0.0) is None


def test_values_that_are_none_or_old_change_nothing() -> None:
    """Not a number, or a time that is not after the last."""
    track = tracked(np.full(5, 5.0))
    assert track.take(1.0, float("nan")) is track
    assert track.take(0.1, 5.0) is track


def test_the_depth_target_keeps_its_bounds_and_follows_a_slope_without_lag() -> None:
    """From 1 m away it arrives without passing by more than 2 cm; on a slope of 3 cm/s it is within 3 mm."""
    shaper, depths = DepthShaper(depth_m=3.0), [3.0]
    for _ in range(200):
        before, shaper = shaper, shaper.towards(4.0, 0.0, 0.1)
        depths.append(shaper.depth_m)
        assert abs(shaper.speed_m_s) <= shaper.fastest_m_s + 1e-9
        assert abs(shaper.speed_m_s - before.speed_m_s) <= shaper.most_m_s2 * 0.1 + 1e-9
    assert max(depths) < 4.02
    assert depths[-1] == pytest.approx(4.0, abs=1e-3)
    for k in range(200):
        shaper = shaper.towards(4.0 + 0.003 * k, 0.03, 0.1)
    assert shaper.depth_m == pytest.approx(4.0 + 0.003 * 199, abs=0.006)
    rested = shaper
    for _ in range(50):
        rested = rested.resting(0.1)
    assert abs(rested.speed_m_s) < 1e-3


def test_a_faster_vehicle_makes_up_for_an_altitude_sooner() -> None:
    """5 cm off, at 0.3 m/s it is within 1 cm in less than 0.6 of the time at 0.1 m/s; below that nothing changes."""
    steps = []
    for pace_m_s in (0.1, 0.3):
        shaper = DepthShaper.at(3.0, pace_m_s)
        steps.append(0)
        while abs(shaper.depth_m - 3.05) > 0.01:
            shaper = shaper.towards(3.05, 0.0, 0.1)
            steps[-1] += 1
    assert steps[1] < 0.6 * steps[0]
    assert DepthShaper.at(3.0, 0.05).bandwidth_rad_s == DepthShaper.at(3.0, 0.1).bandwidth_rad_s == 1.0
