"""Strata of the gentle bench: which trim a seed has and where its current comes from."""

import numpy as np
import pytest

from wakewise_paper.wash_reduction.scenario_files import HALF_SIDE_RAD, SIDES, current_W_m_s, stratum

TRIMS = ("heavy", "neutral", "light")


@pytest.mark.parametrize("turned", range(4))
def test_three_seeds_have_all_trims_and_all_sides_and_nine_have_all_pairs(turned):
    """A Latin square, however it is turned; the tenth seed begins anew."""
    pairs = [stratum(TRIMS, turned, seed) for seed in range(1, 11)]
    for first in (0, 3, 6):
        for part, of in ((0, TRIMS), (1, SIDES)):
            assert {pair[part] for pair in pairs[first : first + 3]} == set(of)
    assert len(set(pairs[:9])) == 9 and pairs[9] == pairs[0]


def test_the_square_is_turned_from_scenario_to_scenario():
    """Over three scenarios the first seed's trim meets every side."""
    assert {stratum(TRIMS, turned, 1)[1] for turned in range(3)} == set(SIDES)
    assert {stratum(("heavy",), 0, seed) for seed in (1, 2, 3)} == {("heavy", side) for side in SIDES}


@pytest.mark.parametrize("side", SIDES)
def test_a_current_comes_from_its_side_and_the_sides_are_all_directions(side):
    """Towards: from the vehicle to the target; away: the other way; abeam: across, either way; 45 deg to both of it."""
    azimuth = 0.7
    outward = np.array([np.cos(azimuth), np.sin(azimuth)])
    cosines = []
    for seed in range(40):
        current = np.array(current_W_m_s(side, azimuth, 0.1, np.random.default_rng(seed)))
        assert np.linalg.norm(current) == pytest.approx(0.1, abs=1e-5) and current[2] == 0.0
        cosines.append(float(current[:2] @ outward) / 0.1)
    edge = np.cos(HALF_SIDE_RAD) + 1e-4
    if side == "abeam":
        assert max(cosines) > 0.3 and min(cosines) < -0.3 and max(map(abs, cosines)) <= edge
    else:
        sign = -1.0 if side == "towards" else 1.0
        assert all(sign * cosine >= np.cos(HALF_SIDE_RAD) - 1e-4 for cosine in cosines)
