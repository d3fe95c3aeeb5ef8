"""What the learned wake is trained on: histories, places, and velocities that mean the same from tank and lattice."""

import numpy as np
import pytest

from wakewise.wake import wake_model
from wakewise.wake.learned import EDGES, Network
from wakewise_paper.learned_wake.evaluation import WakeModelScore, predictors, unit_f
from wakewise_paper.learned_wake.truth import (
    FAR_D,
    LATTICE_HISTORIES,
    NEAR_D,
    THRUSTS_N,
    SampledWater,
    _stepped,
    drawn_history,
    drawn_points,
    even_lattice_rows,
    even_parcel_rows,
    parcel_rows,
)

NARROW = SampledWater(half_width_growth=0.094, wake_life=1.0)


def test_histories_hold_and_rest():
    """Times rise from 0, thrusts lie in their range or are none, and never rest twice in a row."""
    times, thrusts = drawn_history(np.random.default_rng(0), 200.0)
    assert times[0] == 0.0
    assert (np.diff(times) > 0.49).all()
    assert times[-1] < 200.0
    pushing = thrusts > 0.0
    assert ((thrusts[pushing] >= THRUSTS_N[0]) & (thrusts[pushing] <= THRUSTS_N[1])).all()
    assert 0.1 < (~pushing).mean() < 0.5
    assert not (~pushing[1:] & ~pushing[:-1]).any()


def test_places_lie_where_they_should():
    """Within the range of distances, most of them about the jet, some behind the disk."""
    points = drawn_points(np.random.default_rng(0), 2000)
    assert (points.away_D > NEAR_D - 1e-9).all()
    assert (points.away_D < FAR_D + 1e-9).all()
    assert (points.r_D < 0.3 * points.x_D).mean() > 0.4
    assert (points.x_D < 0.0).any()


def test_the_lattices_pushes_are_steps():
    """A pause is a row without thrust; pushes that follow each other at once have none between."""
    times, thrusts = _stepped(LATTICE_HISTORIES["test"])
    assert times.tolist() == [0.0, 8.0, 24.0, 38.0, 50.0]
    assert thrusts.tolist() == [0.6, 1.0, 0.0, 0.8, 0.0]


def test_an_even_jet_of_the_tank_is_the_round_jet_of_its_width():
    """The dimensionless velocity on the axis is within 12 % of the law's, the tank's own error."""
    rows = even_parcel_rows(NARROW, np.random.default_rng(0), instants=2, count=600, likes=2)
    near_axis = (rows.points.r_D < 0.05 * rows.points.x_D) & (rows.points.x_D > 8.0)
    assert near_axis.sum() > 10
    law = unit_f(wake_model("jet"), rows)
    assert np.mean(rows.f[near_axis, 0]) == pytest.approx(np.mean(law[near_axis, 0]), rel=0.12)
    assert rows.steady
    assert rows.history.min() == rows.history.max() == 1.0


def test_lattice_and_law_speak_the_same_units():
    """The lattice's mean jet has 0.6 to 1.1 of the law's velocity on the axis, as its tables say elsewhere."""
    rows = even_lattice_rows("free", np.random.default_rng(0), 800)
    near_axis = (rows.points.r_D < 0.05 * rows.points.x_D) & (rows.points.x_D > 6.0)
    ratio = rows.f[near_axis, 0].mean() / unit_f(wake_model("jet"), rows)[near_axis, 0].mean()
    assert 0.5 < ratio < 1.1


def test_unsteady_rows_carry_their_history():
    """Histories are shares of the greatest thrust; what pushes now stands in the first bin of near points."""
    rows = parcel_rows(NARROW, np.random.default_rng(4), duration_s=8.0, instants=5, count=20)
    assert rows.history.shape == (len(rows), len(EDGES) - 1)
    assert rows.history.min() >= 0.0
    assert rows.history.max() <= 1.0 + 1e-9
    assert ((rows.now >= 0.0) & (rows.now <= 1.0)).all()
    assert np.isfinite(rows.f).all()


def test_a_model_that_says_the_truth_has_no_error():
    """And one that says twice of it is at the edge of the factor of two."""
    rows = even_lattice_rows("free", np.random.default_rng(1), 200)
    right, double = WakeModelScore.of(rows.f, rows), WakeModelScore.of(2.01 * rows.f, rows)
    assert (right.rmse_mm_s, right.factor_of_2_pct) == (0.0, 100.0)
    assert double.error_share == pytest.approx(1.01)
    assert double.factor_of_2_pct == 0.0


def test_every_model_predicts_every_truth():
    """Shapes fit; a width that nobody set is told as not known."""
    rows = even_lattice_rows("free", np.random.default_rng(1), 20)
    found = {name: predict(rows) for name, predict in predictors(Network.drawn(np.random.default_rng(0))).items()}
    assert {f.shape for f in found.values()} == {(20, 2)}
    assert np.isnan(found.pop("jet, width told")).all()
    assert all(np.isfinite(f).all() for f in found.values())
