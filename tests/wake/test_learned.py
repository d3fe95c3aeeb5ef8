"""The learned wake as a model: symmetry and scaling by construction, its table, its history, its floor."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake import WakeSettings, bed_of, free_jet, gram, point_disturbance, wake_model
from wakewise.wake.learned import EDGES, JetPoints, LearnedWake, Network, load_network, save_network, shape, shipped
from wakewise.wake.wall_jet import WALL_SPEED, wall_velocity

AREA = 0.25 * np.pi * 0.06**2
DISK, ALONG_X = np.zeros(3), np.array([1.0, 0.0, 0.0])
DRAWN = LearnedWake(network=Network.drawn(np.random.default_rng(3)))
SHIPPED = wake_model("learned")
MODELS = pytest.mark.parametrize("model", [DRAWN, SHIPPED], ids=["drawn", "shipped"])


def cloud(seed=0, n=60):
    rng = np.random.default_rng(seed)
    return rng.uniform((0.05, -0.3, -0.3), (1.0, 0.3, 0.3), (n, 3))


def unit(model, points, direction=ALONG_X, origin=DISK, area=AREA):
    return model.unit_velocity(points, origin[None], direction[None], np.array([area]))[0]


@MODELS
def test_the_jet_is_the_same_all_round_its_axis(model):
    """Turning a point about the axis turns its velocity along."""
    turn = 1.1
    R = np.array([[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]])
    np.testing.assert_allclose(unit(model, cloud() @ R.T), unit(model, cloud()) @ R.T, atol=1e-12)


@MODELS
def test_no_direction_and_no_place_is_special(model):
    """A jet turned and moved together with its points has its velocities turned."""
    rng = np.random.default_rng(5)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shift = rng.normal(size=3)
    moved = unit(model, cloud() @ R.T + shift, R @ ALONG_X, shift)
    np.testing.assert_allclose(moved, unit(model, cloud()) @ R.T, atol=1e-10)


@MODELS
def test_four_times_the_thrust_in_half_the_time_is_twice_as_fast(model):
    """Dimensions alone; of an even push it says that speed goes with the root of thrust."""
    times, thrusts = np.array([0.0, 1.5, 4.0]), np.array([0.7, 0.0, 1.2])
    once = model.velocity(cloud(), DISK, ALONG_X, AREA, times, thrusts, 6.0)
    fourfold = model.velocity(cloud(), DISK, ALONG_X, AREA, times / 2, 4 * thrusts, 3.0)
    np.testing.assert_allclose(fourfold, 2 * once, rtol=1e-9, atol=1e-12)


@MODELS
def test_the_form_without_history_is_an_even_push(model):
    """The table that is looked up meets the network within 2 % of the exit speed, at any distance and angle."""
    points = cloud(1, 400)
    thrust, exit_speed = 2.0, np.sqrt(2.0 / (998.2 * AREA))
    whole = model.velocity(points, DISK, ALONG_X, AREA, np.zeros(1), np.array([thrust]), 1e6)
    np.testing.assert_allclose(np.sqrt(thrust) * unit(model, points), whole, atol=0.02 * exit_speed)


def test_the_model_is_what_the_network_says():
    """Velocity is sqrt(M) / (R + D) f, part by part, at one point."""
    at = np.array([[0.5, 0.04, 0.0]])
    points = JetPoints(x_D=at[:, 0] / 0.06, r_D=at[:, 1] / 0.06)
    f = shape(SHIPPED.network, points, np.ones((1, len(EDGES) - 1)))[0]
    velocity = SHIPPED.velocity(at, DISK, ALONG_X, AREA, np.zeros(1), np.ones(1), 1e3)[0]
    scale = np.sqrt(1 / SHIPPED.water_density_kg_m3) / (np.hypot(0.5, 0.04) + 0.06)
    np.testing.assert_allclose(velocity, [scale * f[0], scale * f[1], 0.0], rtol=1e-9)


def test_a_jet_has_not_arrived_yet():
    """What began to push a moment ago moves nothing a metre away; a stopped one goes on for a while."""
    far = np.array([[0.8, 0.0, 0.0]])
    even = SHIPPED.velocity(far, DISK, ALONG_X, AREA, np.zeros(1), np.ones(1), 1e3)[0, 0]
    young = SHIPPED.velocity(far, DISK, ALONG_X, AREA, np.zeros(1), np.ones(1), 0.5)[0, 0]
    stopped = SHIPPED.velocity(far, DISK, ALONG_X, AREA, np.array([0.0, 60.0]), np.array([1.0, 0.0]), 60.5)[0, 0]
    assert abs(young) < 0.05 * even
    assert stopped > 0.7 * even
    assert (SHIPPED.velocity(far, DISK, ALONG_X, AREA, np.array([2.0]), np.ones(1), 1.0) == 0).all()


def test_the_shipped_network_keeps_the_law_of_round_jets():
    """On the axis half a metre away between the widest and the narrowest of the jets that it was trained on."""
    narrow, wide = (wake_model(WakeSettings(model="jet", half_width_slope=s, floor=False)) for s in (0.085, 0.2))
    at = np.array([[0.5, 0.0, 0.0]])
    assert unit(wide, at)[0, 0] < unit(SHIPPED, at)[0, 0] < unit(narrow, at)[0, 0]


def test_d_of_it_is_a_quadratic_form():
    """As of every model, though its derivatives are differences."""
    rng = np.random.default_rng(0)
    points, weights = cloud(2, 30), np.ones(30)
    origins, areas = rng.uniform(-0.2, 0.0, (4, 3)), np.full(4, AREA)
    axes = rng.normal(size=(4, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    thrusts = np.array([2.0, -1.0, 0.0, 3.0])
    G = gram(SHIPPED, points, weights, origins, axes, areas)
    s = np.sqrt(np.concatenate([np.maximum(thrusts, 0), np.maximum(-thrusts, 0)]))
    slow = point_disturbance(SHIPPED, points, weights, origins, axes, areas, thrusts)
    assert s @ G @ s == pytest.approx(slow, rel=1e-12)


def test_its_floor_is_that_of_the_other_jets():
    """Wall jets are added to the free jet, and can be had without."""
    floored = wake_model(WakeSettings(model="learned"), 2.0)
    assert (floored.name, bed_of(floored), free_jet(floored).name) == ("learned+floor", 2.0, "learned")
    down, origin = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.5])
    points = np.array([[0.2, 0.1, 1.98]])
    numbers = np.array([2.0, WALL_SPEED / np.sqrt(floored.water_density_kg_m3)])
    wall = wall_velocity(points, origin[None], down[None], np.array([AREA]), numbers)[0]
    added = unit(floored, points, down, origin) - unit(free_jet(floored), points, down, origin)
    np.testing.assert_allclose(added, wall, atol=1e-12)
    with pytest.raises(InputError, match="no bed"):
        wake_model(WakeSettings(model="learned"))


def test_a_file_gives_the_network_back(tmp_path):
    """In single precision; a file that is none is refused in one line."""
    save_network(tmp_path / "n.npz", shipped(), "words")
    for a, b in zip(load_network(tmp_path / "n.npz").weights, shipped().weights, strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(InputError, match=r"no network of a wake model|is no \.npz or \.npy file with arrays"):
        load_network(tmp_path / "none.npz")


def test_histories_that_make_no_sense_are_refused():
    """Times rise, and a jet does not suck."""
    with pytest.raises(InputError, match="must rise"):
        SHIPPED.velocity(cloud(), DISK, ALONG_X, AREA, np.array([1.0, 1.0]), np.ones(2), 3.0)
    with pytest.raises(InputError, match="must not be negative"):
        SHIPPED.velocity(cloud(), DISK, ALONG_X, AREA, np.zeros(1), -np.ones(1), 3.0)
