"""The probe: round-jet laws through the vehicle's own thrusters, history, floor, and what it refuses."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import coral, place_on_bed
from wakewise.simulation.tank.probe import ThrustHistory, probe, read_points, regular_times

VEHICLE = load_vehicle("paper")
AT_REST = Pose(np.zeros(3))


def _one(thruster, thrust_N, until_s=15.0):
    thrusts = np.zeros((2, 8))
    thrusts[:, thruster] = thrust_N
    return ThrustHistory(times_s=np.array([0.0, until_s]), thrusts_N=thrusts)


def test_a_long_running_thruster_sends_a_round_jet():
    """U_c x / sqrt(M) lies in 6.5 to 7.2 beyond ten diameters, along the jet, forward as in reverse."""
    place, axis = VEHICLE.thruster_positions_B_m[4], VEHICLE.thruster_axes_B[4]
    x = np.array([0.7, 1.0])
    for sign in (1.0, -1.0):
        points = place - sign * x[:, None] * axis
        u = probe(VEHICLE, AT_REST, _one(4, sign * 2.0), points).velocities_m_s[-1]
        constant = -sign * u @ axis * x / np.sqrt(2.0 / 1000.0)
        assert np.all((constant > 6.5) & (constant < 7.2))


def test_a_history_holds_until_its_next_row():
    """A row with no thrust ends a jet; one second after its start water far along it still rests."""
    place, axis = VEHICLE.thruster_positions_B_m[4], VEHICLE.thruster_axes_B[4]
    points = place - np.array([[0.15], [1.5]]) * axis
    thrusts = np.zeros((3, 8))
    thrusts[0, 4] = 2.0
    history = ThrustHistory(times_s=np.array([5.0, 6.0, 12.0]), thrusts_N=thrusts)
    assert history.impulse_N_s[4] == pytest.approx(2.0)
    found = probe(VEHICLE, AT_REST, history, points, times_s=regular_times(history, 0.5))
    near, far = found.speeds_m_s.T
    assert found.times_s[[0, -1]].tolist() == [5.0, 12.0]
    assert near[0] == 0.0
    assert near[2] > 0.5
    assert near[-1] < 0.2 * near[2]
    assert far[2] < 0.02


def test_nothing_flows_through_the_floor():
    """On the floor the velocity is along it, and the jet that strikes it runs out there; depth itself is no matter."""
    points = np.array([[0.0, 0.0, 1.0], [0.3, 0.1, 1.0], [0.4, 0.0, 0.99]])
    thrusts = np.zeros((2, 8))
    thrusts[:, 4:] = np.where(VEHICLE.thruster_axes_B[4:, 2] < 0, 1.0, -1.0)
    history = ThrustHistory(times_s=np.array([0.0, 8.0]), thrusts_N=thrusts)
    found = probe(VEHICLE, Pose(np.array([0.0, 0.0, 0.5])), history, points, floor_z_m=1.0).velocities_m_s[-1]
    assert np.abs(found[:2, 2]).max() < 1e-9
    assert np.linalg.norm(found[2]) > 0.02
    deeper = np.array([0.0, 0.0, 7.0])
    lower = probe(VEHICLE, Pose(np.array([0.0, 0.0, 7.5])), history, points + deeper, floor_z_m=8.0).velocities_m_s[-1]
    assert lower == pytest.approx(found, abs=2e-3)


def test_pose_turns_and_moves_the_flow():
    """The flow of a turned and moved vehicle is the turned flow at the turned points."""
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (40, 3))
    history = ThrustHistory(times_s=np.array([0.0, 3.0]), thrusts_N=np.tile(np.linspace(-1, 1, 8), (2, 1)))
    X = Pose(np.array([1.0, -2.0, 3.0]), quat_from_euler(0.2, -0.3, 1.1))
    plain = probe(VEHICLE, AT_REST, history, points).velocities_m_s[-1]
    turned = probe(VEHICLE, X, history, X.apply(points)).velocities_m_s[-1]
    assert turned == pytest.approx(plain @ X.R.T, abs=1e-4)


def test_a_seed_repeats_the_turbulence():
    """With turbulence, the same seed gives the same flow and another one gives another."""
    points = np.array([[0.0, 0.0, 0.8]]) + VEHICLE.thruster_positions_B_m[4:5]
    runs = [
        probe(VEHICLE, AT_REST, _one(4, 2.0, 4.0), points, turbulence=0.25, seed=seed).velocities_m_s[-1]
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_a_target_turns_the_water_aside():
    """With a body on the floor the flow at its foot changes; without a floor it is refused."""
    target = place_on_bed("branching", coral("branching"), 1.0)
    points = target.mesh.vertices_m[:50] - np.array([0.0, 0.0, 0.01])
    history = _one(4, 2.0, 3.0)
    X = Pose(np.array([0.0, 0.0, 0.4]))
    with_it = probe(VEHICLE, X, history, points, floor_z_m=1.0, target=target).velocities_m_s[-1]
    without = probe(VEHICLE, X, history, points, floor_z_m=1.0).velocities_m_s[-1]
    assert not np.allclose(with_it, without, atol=1e-5)
    with pytest.raises(InputError, match="stands on a floor"):
        probe(VEHICLE, X, history, points, target=target)


def test_bad_points_are_refused(tmp_path):
    """A missing column, no rows, a point below the floor."""
    path = tmp_path / "p.csv"
    path.write_text("x_m,y_m\n0,0\n")
    with pytest.raises(InputError, match="no column z_m"):
        read_points(path)
    path.write_text("z_m,y_m,x_m\n")
    with pytest.raises(InputError, match="no points"):
        read_points(path)
    path.write_text("z_m,y_m,x_m\n3,2,1\n")
    assert read_points(path).tolist() == [[1.0, 2.0, 3.0]]
    with pytest.raises(InputError, match=r"point 1 at \(1, 2, 3\) m is below the floor"):
        probe(VEHICLE, AT_REST, _one(4, 1.0), read_points(path), floor_z_m=1.0)
    with pytest.raises(InputError, match="flow: 'magic'"):
        probe(VEHICLE, AT_REST, _one(4, 1.0), read_points(path), flow="magic")
    with pytest.raises(InputError, match="lattice"):
        probe(VEHICLE, AT_REST, _one(4, 1.0), read_points(path), flow="lattice", floor_z_m=5.0)
    with pytest.raises(InputError, match="times"):
        probe(VEHICLE, AT_REST, _one(4, 1.0), read_points(path), times_s=np.array([0.0, 99.0]))


def test_a_hull_in_the_floor_is_refused():
    """Though all its thrusters are above the floor; and so is a floor that is no number."""
    points = np.array([[0.5, 0.0, 0.5]])
    with pytest.raises(InputError, match=r"hull of paper reaches down to z = 1\.040 m, the floor is at 1 m"):
        probe(VEHICLE, Pose(np.array([0.0, 0.0, 0.9])), _one(4, 1.0), points, floor_z_m=1.0)
    with pytest.raises(InputError, match="floor: nan m"):
        probe(VEHICLE, AT_REST, _one(4, 1.0), points, floor_z_m=float("nan"))


def test_a_hull_in_the_target_is_refused():
    """Above the floor but over the coral's branches; a hand's breadth higher it is answered."""
    target = place_on_bed("branching", coral("branching"), 1.5)
    points = np.array([[0.5, 0.0, 0.5]])
    with pytest.raises(InputError, match=r"hull of paper at \(0, 0, 1\.3\) m is inside the target branching"):
        probe(VEHICLE, Pose(np.array([0.0, 0.0, 1.3])), _one(4, 1.0, 0.1), points, floor_z_m=1.5, target=target)
    clear = Pose(np.array([0.0, 0.0, 1.1]))
    assert probe(VEHICLE, clear, _one(4, 1.0, 0.1), points, floor_z_m=1.5, target=target).known.all()


def test_the_lattice_says_where_it_knows_nothing():
    """On a jet's axis it knows the flow, half a metre off it nothing; with no thruster running water is at rest."""
    place, axis = VEHICLE.thruster_positions_B_m[4], VEHICLE.thruster_axes_B[4]
    off = np.cross(axis, [1.0, 0.0, 0.0])
    points = place - 0.5 * axis + np.array([[0.0], [0.5], [0.3]]) * off
    thrusts = np.zeros((3, 8))
    thrusts[0, 4] = 2.0
    history = ThrustHistory(times_s=np.array([0.0, 1.0, 2.0]), thrusts_N=thrusts)
    found = probe(VEHICLE, AT_REST, history, points, flow="lattice")
    assert found.known.tolist() == [[True, False, True], [True] * 3, [True] * 3]
    assert found.speeds_m_s[0, 0] > 0.1
    assert not found.speeds_m_s[1].any()
    far = place - 3.0 * axis + np.array([[0.9], [2.0]]) * off  # the box goes on as a cone
    assert probe(VEHICLE, AT_REST, history, far, flow="lattice").known[0].tolist() == [True, False]
    with pytest.raises(InputError, match="swirl need parcels"):
        probe(VEHICLE, AT_REST, history, points, flow="lattice", swirl=True)
