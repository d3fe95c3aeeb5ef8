"""Jets in water that moves: still water's jets without a current, published paths and penetration with one."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wakewise.core.errors import InputError
from wakewise.wake import GaussianJet, PaperJet, RoundJet, gram, wake_model
from wakewise.wake.advected_jets import LINE_PUFF_GROWTH, OPPOSING_SHARE, SECTIONS, CrossFlow, plumes
from wakewise.wake.disturbance import advected_velocity

AREA = 0.0045
D = float(np.sqrt(4.0 * AREA / np.pi))
RHO = 998.2
AHEAD = np.array([[1.0, 0.0, 0.0]])
WHOLE = np.array([[np.inf, 1.0]])


def flow(current=(0.0, 0.0, 0.0), unsure=0.0, thrusts=(1.0,)):
    return CrossFlow(current_W_m_s=np.array(current, float), current_std_m_s=unsure, thrusts_N=np.array(thrusts, float))


def curve(current, thrust=1.0, unsure=0.0, jet=None):
    """The sections of one plume that leaves the origin northwards, shape (SECTIONS + 1, 7)."""
    law = (jet or RoundJet()).law
    places = (np.zeros((1, 3)), np.zeros((1, 3)), AHEAD, np.array([AREA]))
    return plumes(*places, law, np.array([thrust]), flow(current, unsure), WHOLE)[1][0]


def exit_speed(thrust):
    return np.sqrt(thrust / (RHO * AREA))


def random_case(seed=0, n=120, m=6):
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(m, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    points = np.array([0.6, 0.0, 0.1]) + rng.uniform(-0.2, 0.2, (n, 3))
    return points, rng.uniform(0.1, 1.0, n), rng.uniform(-0.2, 0.2, (m, 3)), axes, rng.uniform(0.003, 0.006, m)


@pytest.mark.parametrize("name", ["jet", "jet-fitted", "paper-calibrated", "fitted", "linear"])
def test_without_a_current_plumes_are_the_jets_of_still_water(name):
    """The Gram matrix of a flow at rest is that of no flow, of each model, once the jets have arrived."""
    place, still = random_case(), flow(thrusts=np.full(6, 50.0))
    model = wake_model(name)
    np.testing.assert_allclose(gram(model, *place, flow=still), gram(model, *place), rtol=1e-6, atol=1e-9)


def test_the_path_is_that_of_the_equations():
    """A solver of differential equations, the law written anew, root by polynomial: same places to a centimetre."""
    jet, thrust = RoundJet(), 1.0
    current = np.array([-0.02, 0.08, 0.01])
    slope, decay = jet.width_slope, jet.decay

    def rates(_, y):
        s, grown = max(y[3], 1e-6), y[4]
        still = decay * np.sqrt(thrust / RHO) / (s**6 + (decay * np.sqrt(AREA)) ** 6) ** (1 / 6)
        b = slope * s
        core = np.sqrt(max(thrust / RHO / (np.pi * still**2) + (np.pi / 8 - 0.5) * b**2, 0.0)) - np.sqrt(np.pi / 8) * b
        a = max(core, 0.0)
        chi = (a**2 + np.sqrt(np.pi / 2) * a * b + b**2 / 2) / (a**2 + np.sqrt(np.pi) * a * b + b**2)
        along = current[0] * (OPPOSING_SHARE if current[0] < 0 else 1.0)
        strength = chi * still**2 / max(grown / s, 1.0) ** 2
        roots = np.roots([chi**2, 2 * chi * along, current @ current, 0.0, -(strength**2)])
        U = max(r.real for r in roots if abs(r.imag) < 1e-9)
        v = chi * U * AHEAD[0] + current
        cosine = np.clip(v[0] / np.linalg.norm(v), 0.0, 1.0)
        return [*v, chi * U, chi * U * (cosine + LINE_PUFF_GROWTH * np.sqrt(1 - cosine**2))]

    found = curve(current, thrust)
    rho = RoundJet().water_density_kg_m3
    assert rho == pytest.approx(RHO, rel=1e-3)
    slow = solve_ivp(rates, (0.0, 20.0), [0, 0, 0, 1e-6, 1e-6], t_eval=found[1:28, 3], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found[1:28, :3], slow.y[:3].T, atol=0.01)
    np.testing.assert_allclose(found[1:28, 4], slow.y[3], rtol=0.02, atol=2e-3)


def test_a_front_stops_against_the_current_where_it_is_measured_to():
    """2.0 to 2.8 D U_j / c (published: 2.4 to 2.8), whatever the thrust; after that it comes back past the disk."""
    for thrust, c in ((1.0, 0.05), (1.0, 0.1), (3.0, 0.1)):
        found = curve((-c, 0.0, 0.0), thrust)
        assert 2.0 < found[:, 0].max() * c / (D * exit_speed(thrust)) < 2.8
    weak = curve((-0.1, 0.0, 0.0), 0.3)
    assert weak[-1, 0] < -1.0


def test_a_jet_bends_across_the_current_as_measured():
    """Within 30 % of z / rD = 2.05 (x / rD)^.28 (Pratte and Baines 1967) from rD to 5 rD."""
    for thrust, c in ((1.0, 0.1), (1.0, 0.05), (3.0, 0.1)):
        found, reach = curve((0.0, c, 0.0), thrust), D * exit_speed(thrust) / c
        for x in (1.0, 2.0, 5.0):
            z = np.interp(x * reach, found[:, 1], found[:, 0]) / reach
            assert z == pytest.approx(2.05 * x**0.28, rel=0.3)


@pytest.mark.parametrize("current", [(0.06, 0.0, 0.0), (-0.06, 0.03, 0.0), (0.0, 0.08, 0.0)])
def test_every_section_carries_the_thrust(current):
    """U |chi U e + c| times the area is chi U_0^2 times the straight jet's: here, beyond the core, chi is a half."""
    found, c = curve(current), np.array(current)
    rows = found[(found[:, 4] > 1.5)]
    still = RoundJet().speed(rows[:, 4], np.zeros(len(rows)), np.ones(len(rows)), np.full(len(rows), AREA))
    U = rows[:, 5] * still
    along = c[0] * (OPPOSING_SHARE if c[0] < 0 else 1.0)
    speed = np.sqrt((0.5 * U) ** 2 + U * along + c @ c)
    np.testing.assert_allclose(U * speed * rows[:, 6] ** 2, 0.5 * still**2, rtol=2e-3)


def test_mirrored_currents_give_mirrored_plumes():
    """Port and starboard, up and down."""
    one, other = curve((0.02, 0.05, -0.03)), curve((0.02, -0.05, 0.03))
    np.testing.assert_allclose(one[:, :3] * [1.0, -1.0, -1.0], other[:, :3], atol=1e-12)
    np.testing.assert_allclose(one[:, 3:], other[:, 3:], atol=1e-12)


def test_what_is_unsure_is_wider_and_lower_and_keeps_its_mean_square():
    """Speed times width is kept at each section, so the mean square over a plane across the plume is, too."""
    sure, unsure = curve((0.0, 0.05, 0.0)), curve((0.0, 0.05, 0.0), unsure=0.02)
    np.testing.assert_allclose(sure[:, :5], unsure[:, :5])
    np.testing.assert_allclose((sure[:, 5] * sure[:, 6]), unsure[:, 5] * unsure[:, 6])
    assert unsure[-1, 6] > 2.0 * sure[-1, 6]


def test_points_in_a_plume_have_the_speed_of_the_nearest_section():
    """On the curve it is the section's own; the fast way through all sections finds what a plain search does."""
    jet, c = RoundJet(), (0.01, 0.06, 0.0)
    found = curve(c)
    rng = np.random.default_rng(2)
    points = found[5:20:3, :3] + rng.normal(scale=0.03, size=(5, 3))
    fast = advected_velocity(jet, points, np.zeros((1, 3)), AHEAD, np.array([AREA]), np.ones(1), flow(c))[0]
    np.testing.assert_array_equal(fast[:, 1:], 0.0)
    for point, u in zip(points, fast[:, 0], strict=True):
        best = 0.0
        for k in range(SECTIONS):
            a, b = found[k], found[k + 1]
            way = b[:3] - a[:3]
            share = (point - a[:3]) @ way / (way @ way)
            after = found[k + 2, :3] - b[:3] if k + 2 <= SECTIONS else None
            outside = share > 1.0 and after is not None and (point - b[:3]) @ after <= 0.0
            if not (0.0 < share <= 1.0 or outside):
                continue
            row = a + min(share, 1.0) * (b - a)
            r = np.linalg.norm(point - row[:3]) / row[6]
            best = max(best, float(jet.speed(row[4], r, 1.0, AREA)) * row[5])
        assert u == pytest.approx(best, rel=1e-6, abs=1e-9)
    assert np.count_nonzero(fast[:, 0]) >= 4


def test_d_stays_a_sum_of_squares():
    """In any current the Gram matrix is symmetric and has no negative eigenvalue, with a floor, too."""
    points, weights, *jets = random_case(3)
    for model in (
        RoundJet(),
        wake_model("fitted"),
        GaussianJet(decay=6.0, virtual_origin_diameters=3.0, start_width_diameters=0.7, half_width_slope=0.1),
        PaperJet(),
    ):
        G = gram(model, points, weights, *jets, flow=flow((0.05, -0.1, 0.02), 0.02, np.linspace(-1.0, 1.0, 6)))
        np.testing.assert_allclose(G, G.T)
        assert np.isfinite(G).all() and np.linalg.eigvalsh(G).min() > -1e-12 * np.abs(G).max()


def test_a_thruster_at_rest_is_guessed_to_push_a_share_of_the_mean():
    """Both signs have a size, so that a jet that would be new is seen too."""
    assert np.array_equal(
        flow(thrusts=(1.0, -3.0, 0.0, 0.0)).nominal_thrusts_N, [1.0, 0.5, 0.5, 0.5, 0.5, 3.0, 0.5, 0.5]
    )
    assert flow(thrusts=(0.0, 0.0)).nominal_thrusts_N.min() > 0.0


def test_what_is_wrong_is_refused():
    """A current that is not finite, and weights as ever."""
    points, weights, *jets = random_case()
    with pytest.raises(InputError, match="current_W_m_s"):
        flow((np.nan, 0.0, 0.0), thrusts=np.ones(6))
    with pytest.raises(InputError, match="weight"):
        gram(RoundJet(), points, -weights, *jets, flow=flow((0.1, 0.0, 0.0), thrusts=np.ones(6)))


def test_models_from_outside_have_no_law_that_a_current_could_carry():
    """Asked for their plumes they are refused in words; their Gram matrix is that of still water."""

    class Outside:
        name = "outside"

        def unit_velocity(self, points, origins, directions, area):
            return np.ones((len(origins), len(points), 1)) * directions[:, None, :]

    place = random_case()
    moving = flow((0.1, 0.0, 0.0), thrusts=np.ones(6))
    np.testing.assert_array_equal(gram(Outside(), *place, flow=moving), gram(Outside(), *place))
    with pytest.raises(InputError, match="outside"):
        advected_velocity(Outside(), place[0], *place[2:], np.ones(6), moving)
