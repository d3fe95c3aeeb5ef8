"""When the filter gives in to poses that it takes for wrong, and how sure it takes an acceleration to be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Measurement
from wakewise.estimation import ErrorStateFilter, eskf
from wakewise.estimation.settings import FilterSettings, Priors
from wakewise.robot.vehicles import load_vehicle

VEHICLE = load_vehicle("paper")
HERE, THERE = np.array([0.0, 0.0, 1.0]), np.array([0.1, 0.0, 1.0])
DT = 0.02
"""The other place is fifty standard deviations of a pose away, and three of the filter's doubt at its start."""


def told(priors: Priors, places: list[np.ndarray]) -> tuple[list[float], int]:
    """How far north the filter takes the vehicle to be after each pose, and how many poses it left out."""
    filter_ = ErrorStateFilter(VEHICLE, priors=priors)
    state = filter_.init(BodyState(X_WB=Pose(HERE)))
    north = []
    for k, place in enumerate(places):
        seen = Measurement(time_s=(k + 1) * DT, X_WB=Pose(place))
        state, estimate = filter_.step(state, DT, (seen,), np.zeros(8))
        north.append(float(estimate.X_WB.p_m[0]))
    return north, state.rejected


@pytest.mark.parametrize("patience", [4, 15])
def test_it_gives_in_after_so_many_wrong_poses_in_a_row(patience: int) -> None:
    """Until then the place stays; after it the filter goes where all poses say the vehicle is."""
    priors = Priors(gate_patience=patience, settle_s=0.0)
    north, rejected = told(priors, [HERE] * 20 + [THERE] * (patience + 10))
    assert max(np.abs(north[: 20 + patience])) < 0.02
    assert north[-1] == pytest.approx(0.1, abs=0.02)
    assert rejected == patience


def test_a_right_pose_in_between_ends_the_row() -> None:
    """Wrong poses that are never so many in a row are left out for good, however many they are together."""
    row = [THERE] * 3 + [HERE]
    north, rejected = told(Priors(gate_patience=4, settle_s=0.0), [HERE] * 20 + row * 10)
    assert max(np.abs(north)) < 0.02
    assert rejected == 30


@pytest.mark.parametrize("period_s", [0.01, 0.04])
def test_the_models_white_error_counts_over_the_period_of_the_sensor(
    monkeypatch: pytest.MonkeyPatch, period_s: float
) -> None:
    """Over a longer period a white acceleration averages out: its variance goes with one over the period."""
    used: list[float] = []

    def listening(*args: Any) -> float:
        used.append(float(args[7]))
        return 0.0

    monkeypatch.setattr(eskf, "correct_by_force", listening)
    settings, priors = FilterSettings(), Priors(acceleration_noise_m_s2=0.05, settle_s=0.0)
    filter_ = ErrorStateFilter(VEHICLE, settings, priors=priors)
    state = filter_.init(BodyState(X_WB=Pose(HERE)))
    both = tuple(
        Measurement(time_s=time_s, force_B_m_s2=np.array([0.0, 0.0, -9.8])) for time_s in (0.02, 0.02 + period_s)
    )
    filter_.step(state, 0.1, both, np.zeros(8))
    assert used[1] == pytest.approx(math.hypot(settings.accelerometer_std_m_s2, 0.05 / math.sqrt(period_s)))
