"""Tracking weights are scaled until a plan keeps the limit of its deviation."""

import numpy as np
import pytest

from wakewise.control.mpc_controller import LARGEST_SCALE, scale_tracking, tracking_deviation
from wakewise.control.velocity_reference import PAPER_DEVIATION, PAPER_W_TRACK, deviation_limit


def way(speed_m_s, stages=20, stage_s=0.1):
    """States along x at a speed, shape (stages + 1, 13)."""
    states = np.zeros((stages + 1, 13))
    states[:, 0] = speed_m_s * stage_s * np.arange(stages + 1)
    return states


def test_a_stray_is_the_share_of_the_way_that_is_not_gone():
    """None of a plan that goes along, also from beside the way; a half of one at half the speed; bounded at rest."""
    asked = way(0.1)
    assert tracking_deviation(asked + 0.03, asked, 0.1) == pytest.approx(0.0)
    assert tracking_deviation(way(0.05), asked, 0.1) == pytest.approx(0.5)
    assert tracking_deviation(way(0.001), way(0.0), 0.1) == pytest.approx(0.05)


def test_what_a_plan_means_to_make_up_for_later_counts_as_undone():
    """Made anew ten times a second, it never would."""
    late = way(0.0)
    late[10:, 0] = np.linspace(0.0, 0.2, 11)
    assert tracking_deviation(late, way(0.1), 0.1) == pytest.approx(1.0)


def test_scale_grows_within_half_a_second_and_goes_again():
    """A plan that leaves most undone is at the bound in six plans; one that keeps the promise gets its weights back."""
    scale, allowed = 1.0, deviation_limit(PAPER_W_TRACK)
    for _ in range(6):
        scale = scale_tracking(scale, 0.8, allowed)
    assert scale == LARGEST_SCALE
    for _ in range(25):
        scale = scale_tracking(scale, 0.0, allowed)
    assert scale == 1.0


def test_more_is_promised_by_a_larger_w_track_and_nothing_to_a_mission():
    """The dial orders what is allowed; a goal that allows any stray leaves the weights alone."""
    shares = [deviation_limit(w) for w in (1.0, 2.0, 5.0, 10.0, 20.0)]
    assert shares == sorted(shares, reverse=True) and shares[2] == PAPER_DEVIATION
    assert scale_tracking(50.0, 0.9, None) == 1.0
