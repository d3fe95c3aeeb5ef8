"""What jets lift from the bed follows the impinging jet's law, and counts where it drifts before the camera."""

import numpy as np
import pytest

from wakewise.geometry import Pose
from wakewise.wake import silt
from wakewise.wake.silt import BEDS, SiltView, depth_of_source, lifted_kg_s_N, peak_stress_Pa, silt_gram, strikes

AREA = np.pi * 0.03**2
SILT = BEDS["silt"]
DOWN = np.array([[0.0, 0.0, -1.0]])  # force up, so the jet goes down
EYE, SEEN = np.array([0.0, 0.0, 1.1]), np.array([[0.5, 0.0, 1.3], [0.5, 0.05, 1.4]])
BED_Z = 1.5


def gram_of(origin, current=(0.0, 0.0, 0.0), axis=DOWN, thrust=1.0):
    """Matrix of one thruster."""
    return silt_gram(
        np.array([origin]), axis, np.array([AREA]), np.array([thrust]), BED_Z, np.array(current), EYE, SEEN, SILT
    )


def test_a_jet_strikes_the_bed_on_its_axis():
    """Straight below an upright thruster, ahead by the tangent of a slanting one, and never for one that blows up."""
    slant = np.array([-np.sin(0.5), 0.0, -np.cos(0.5)])
    found = strikes(np.array([[0.1, 0.2, 1.0], [0.1, 0.2, 1.0]]), np.stack([DOWN[0], slant]), BED_Z)
    assert found.lands.tolist() == [True, True, False, False]
    np.testing.assert_allclose(found.places_W_m[:2], [[0.1, 0.2], [0.1 + 0.5 * np.tan(0.5), 0.2]])
    np.testing.assert_allclose(found.reach_m[:2], [0.5, 0.5 / np.cos(0.5)])
    np.testing.assert_allclose(found.ahead_W[1], [np.sin(0.5), 0.0], atol=1e-15)


def test_stress_is_that_of_beltaos_and_rajaratnam():
    """0.16 rho U0^2 (d / H)^2 with rho U0^2 = T / A, and no more than at the core's end nearer by."""
    d, T = 0.06, 2.0
    assert peak_stress_Pa(T, 0.6, AREA) == pytest.approx(0.16 * T / AREA * (d / 0.6) ** 2)
    assert peak_stress_Pa(-T, 0.6, AREA) == peak_stress_Pa(T, 0.6, AREA)
    assert peak_stress_Pa(T, 0.1, AREA) == peak_stress_Pa(T, 6.3 * d, AREA)


def test_what_is_lifted_is_the_integral_over_the_bed():
    """Partheniades' rate of a stress that is even within 0.14 H and falls as 1 / r^2 beyond, summed over rings."""
    T, H = 1.3, 0.6
    r = np.linspace(0.0, 3.0, 300_001)
    middle, dr = 0.5 * (r[1:] + r[:-1]), r[1] - r[0]
    stress = peak_stress_Pa(T, H, AREA) * np.minimum(1.0, (0.14 * H / middle) ** 2)
    rate = SILT.erosion_kg_m2_s * np.maximum(stress / SILT.threshold_Pa - 1.0, 0.0)
    assert T * lifted_kg_s_N(T, H, AREA, SILT) == pytest.approx((rate * 2 * np.pi * middle).sum() * dr, rel=1e-4)


def test_nothing_is_lifted_below_the_threshold():
    """A jet that stresses the bed less than its threshold has no entry, nor has one that never lands."""
    least = SILT.threshold_Pa * 0.6**2 / silt.STRESS
    assert lifted_kg_s_N(0.99 * least, 0.6, AREA, SILT) == 0.0 < lifted_kg_s_N(1.01 * least, 0.6, AREA, SILT)
    assert not gram_of([0.2, 0.0, 0.9], thrust=0.99 * least).any()
    assert not gram_of([0.2, 0.0, 0.9], axis=-DOWN)[0, 0]


def test_the_matrix_is_diagonal_and_not_negative():
    """So is every depth, whatever the thrusts; and another jet's slot is as it is alone."""
    rng = np.random.default_rng(1)
    axes = rng.normal(size=(6, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    places = rng.uniform([-0.3, -0.3, 0.8], [0.3, 0.3, 1.2], (6, 3))
    S = silt_gram(places, axes, np.full(6, AREA), np.ones(6), BED_Z, np.array([0.03, 0.0, 0.0]), EYE, SEEN, SILT)
    assert np.all(np.diag(S) >= 0.0) and np.diag(S).any()
    np.testing.assert_array_equal(S, np.diag(np.diag(S)))
    alone = gram_of(places[2], (0.03, 0.0, 0.0), axes[2:3])
    np.testing.assert_allclose(np.diag(alone), np.diag(S)[[2, 8]])


def test_a_current_carries_the_jet_before_it_strikes():
    """By its speed times H^2 / (K sqrt(T / rho)): a thruster that much upstream strikes where another does at once."""
    H, u = 0.6, 0.02
    shift = u * H**2 / (silt.ROUND_DECAY * np.sqrt(1.0 / silt.FRESH_WATER_KG_M3))
    reach, source = np.array([H]), []
    for x in (0.3, 0.3 + shift):
        run = np.array([silt.RUNS * np.sqrt(1.0 / silt.FRESH_WATER_KG_M3)])
        start = silt.PEAK_AT * reach * np.sqrt(peak_stress_Pa(1.0, reach, AREA) / SILT.threshold_Pa)
        place, current = np.array([[x, 0.0]]), np.array([u, 0.0, 0.0])
        source.append(depth_of_source(place, np.zeros((1, 2)), start, run, current, BED_Z, EYE, SEEN, SILT)[0])
    found = gram_of([0.3, 0.0, BED_Z - H], (u, 0.0, 0.0))[0, 0]
    assert found == pytest.approx(lifted_kg_s_N(1.0, H, AREA, SILT) * source[1], rel=1e-9)
    assert found != pytest.approx(lifted_kg_s_N(1.0, H, AREA, SILT) * source[0], rel=0.05)


def test_a_jet_that_rests_is_priced_as_the_others_blow():
    """Else load would jump to it: its entry is that of a jet with the root mean square of all thrusts."""
    places, axes = np.array([[0.2, 0.1, 0.9], [0.2, -0.1, 0.9]]), np.repeat(DOWN, 2, axis=0)
    S = silt_gram(
        places, axes, np.full(2, AREA), np.array([0.0, 2.0]), BED_Z, np.zeros(3), EYE, SEEN, SILT
    )  # fmt: skip
    assert S[0, 0] == pytest.approx(gram_of(places[0], thrust=np.sqrt(2.0))[0, 0])
    assert S[1, 1] == pytest.approx(gram_of(places[1], thrust=2.0)[0, 0])


def test_the_depth_is_that_of_its_puffs():
    """The sum over ages and rays, written out with many more of both, agrees within what ten ages can tell."""
    place, start, run, current = np.array([0.15, -0.1]), 0.08, 0.026, np.array([0.02, 0.01, 0.0])
    ahead, ages, steps = np.array([0.3, 0.1]), np.linspace(0.0, silt.AGES_S, 2001), 400
    total = 0.0
    for age in 0.5 * (ages[1:] + ages[:-1]):
        radius = np.sqrt(start**2 + 2.0 * run * age)
        middle, thick = place + (radius - start) * ahead + age * current[:2], 0.09 * radius
        for end in SEEN:
            points = EYE + ((np.arange(steps) + 0.5) / steps)[:, None] * (end - EYE)
            level = np.exp(-np.sum((points[:, :2] - middle) ** 2, axis=1) / (2.0 * (radius / 2.0) ** 2))
            there = level / (2.0 * np.pi * (radius / 2.0) ** 2) * np.exp(-(BED_Z - points[:, 2]) / thick) / thick
            sunk = np.exp(-SILT.settling_m_s * age / thick)
            total += (ages[1] - ages[0]) * sunk * there.mean() * np.linalg.norm(end - EYE) / len(SEEN)
    found = depth_of_source(
        place[None], ahead[None], np.array([start]), np.array([run]), current, BED_Z, EYE, SEEN, SILT
    )
    assert found[0] == pytest.approx(SILT.attenuation_m2_kg * total, rel=0.15)


def test_silt_that_the_current_takes_away_counts_nothing():
    """The same strike upstream of the rays counts more than without a current, downstream next to nothing."""
    towards, still, away = (gram_of([-0.6, 0.0, 0.9], (u, 0.0, 0.0))[0, 0] for u in (0.06, 0.0, -0.2))
    assert towards > still
    assert away < 1e-3 * still


def test_a_view_adds_what_its_pose_and_camera_make():
    """The bodily places of thrusters and camera are moved to the world, and a depth is priced in (m/s)^2."""
    X_WB = Pose(np.array([0.0, 0.0, 0.9]))
    view = SiltView(
        bed=SILT,
        bed_z_m=BED_Z,
        eye_B_m=EYE - X_WB.p_m,
        seen_W_m=SEEN,
        positions_B_m=np.array([[0.2, 0.0, 0.0]]),
        axes_B=DOWN,
        areas_m2=np.array([AREA]),
    )
    expected = silt.DEPTH_WORTH_M2_S2 * gram_of([0.2, 0.0, 0.9])
    np.testing.assert_allclose(view.gram(X_WB, np.array([1.0]), np.zeros(3)), expected)
