"""What a trial is told about its water, against flows whose answer is known."""

import numpy as np
import pytest

from wakewise.core.interfaces import ScalarGrid
from wakewise.scene.targets import Mesh, place_on_bed
from wakewise.simulation.tank.grains import beam_attenuation_per_m, friction_velocity_m_s, speed_at_stress_m_s
from wakewise.simulation.tank.sediment import SHEAR_HEIGHT_M, SiltProperties
from wakewise.simulation.tank.water_truth import FRAME_S, TargetProbes, concentration_at, tracer_speeds_m_s

PYRAMID = place_on_bed(
    "pyramid",
    Mesh(
        np.array([[0.07, 0.07, 0], [-0.07, 0.07, 0], [-0.07, -0.07, 0], [0.07, -0.07, 0], [0, 0, 0.15]]),
        np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]]),
    ),
    1.5,
)
LAWS = SiltProperties.of(20e-6, 2710.0, 1000.0, 5e-5)
EYE = np.array([0.5, 0.0, 1.2])


class Stream:
    """A uniform current and a uniform excess."""

    def __init__(self, excess, current):
        self.excess, self.current = np.array(excess, float), np.array(current, float)

    def excess_velocity(self, points):
        return np.tile(self.excess, (len(points), 1))

    def ambient_velocity(self, points):
        return np.tile(self.current, (len(points), 1))

    def velocity(self, points):
        return self.excess_velocity(points) + self.ambient_velocity(points)


def test_excess_speeds_and_whole_pressures():
    """Speeds leave the current out; pressure, shear and tracers have it in."""
    measure = TargetProbes(PYRAMID, np.random.default_rng(0)).measure(
        Stream([0.3, 0, 0], [0, 0.4, 0]), LAWS, None, EYE, 1000.0
    )
    assert measure.target_speed_mean_m_s == pytest.approx(0.3)
    assert measure.target_speed_p95_m_s == pytest.approx(0.3)
    assert measure.bed_speed_p95_m_s == pytest.approx(0.3)
    assert measure.target_pressure_mean_Pa == pytest.approx(0.5 * 1000 * 0.25)
    assert measure.target_pressure_p95_Pa == pytest.approx(125.0)
    star = friction_velocity_m_s(0.5, SHEAR_HEIGHT_M, LAWS.grain_m)
    assert measure.bed_shear_p95_Pa == pytest.approx(1000.0 * float(star) ** 2)
    assert measure.tracer_speed_mean_m_s == pytest.approx(0.5)
    assert measure.turbidity_per_m == measure.ray_optical_depth == 0.0
    assert (measure.target_over_1cm_s, measure.target_over_ambient) == (1.0, 0.0)  # .3 m/s in a stream of .4


class Calm(Stream):
    """Water that runs on one side of a line alone."""

    def excess_velocity(self, points):
        return np.where(points[:, :1] > PYRAMID.centre_W_m[0], self.excess, 0.0)


def test_grains_move_where_the_stress_is_above_their_threshold():
    """Everywhere in a stream above it, nowhere below it, on half of the bed where half of it has the stream."""
    probes = TargetProbes(PYRAMID, np.random.default_rng(0))
    at_limit = speed_at_stress_m_s(LAWS.threshold_Pa / 1000.0, SHEAR_HEIGHT_M, LAWS.grain_m)

    def share(water):
        return probes.measure(water, LAWS, None, EYE, 1000.0).bed_over_threshold

    assert share(Stream([1.05 * at_limit, 0, 0], [0, 0, 0])) == 1.0
    assert share(Stream([0.95 * at_limit, 0, 0], [0, 0, 0])) == 0.0
    assert share(Calm([1.05 * at_limit, 0, 0], [0, 0, 0])) == pytest.approx(0.5, abs=0.1)


def test_exceedance_of_still_water_is_not_known():
    """Excess of 5 mm/s is nowhere over 1 cm/s; over the ambient speed it is everywhere, or nobody can say."""
    probes = TargetProbes(PYRAMID, np.random.default_rng(0))
    running, still = (probes.measure(Stream([0.005, 0, 0], [0, v, 0]), LAWS, None, EYE, 1000.0) for v in (0.004, 0.0))
    assert (running.target_over_1cm_s, running.target_over_ambient) == (0.0, 1.0)
    assert np.isnan(still.target_over_ambient)


def test_a_steady_current_is_asked_for_once_and_another_each_time():
    """Of water that says it is steady the first answer stands, until other water is looked at."""
    probes = TargetProbes(PYRAMID, np.random.default_rng(0))
    steady, other, waves = (
        Stream([0, 0, 0], [0.2, 0, 0]),
        Stream([0, 0, 0], [0.4, 0, 0]),
        Stream([0, 0, 0], [0.1, 0, 0]),
    )
    steady.steady = other.steady = True

    def pressure_Pa(water):
        return probes.measure(water, LAWS, None, EYE, 1000.0).target_pressure_mean_Pa

    assert pressure_Pa(steady) == pytest.approx(20.0)
    steady.current = np.array([9.0, 0, 0])  # which would be a lie
    assert pressure_Pa(steady) == pytest.approx(20.0)
    assert pressure_Pa(other) == pytest.approx(80.0)
    for speed in (0.1, 0.3):
        waves.current = np.array([speed, 0, 0])
        assert pressure_Pa(waves) == pytest.approx(500 * speed**2)


def test_even_silt_dims_a_ray_by_attenuation_times_length():
    """In an even cloud the mean optical depth is c times the mean way from the camera to the side it faces."""
    probes = TargetProbes(PYRAMID, np.random.default_rng(0))
    silt = ScalarGrid(origin_W_m=np.array([-0.8, -0.8, 0.5]), spacing_m=0.05, values=np.full((33, 33, 21), 0.02))
    c = float(beam_attenuation_per_m(0.02, LAWS.grain_m, LAWS.grain_density_kg_m3))
    assert probes.turbidity_per_m(LAWS, silt) == pytest.approx(c)
    ends = probes.surface_W_m[::5]
    ends = ends[(ends - PYRAMID.centre_W_m) @ (EYE - PYRAMID.centre_W_m) > 0.0]
    way = np.linalg.norm(ends - EYE, axis=1).mean()
    assert probes.ray_optical_depth(LAWS, silt, EYE) == pytest.approx(c * way)
    far = EYE + np.array([1.0, 0.0, 0.0])
    assert probes.ray_optical_depth(LAWS, silt, far) < 0.7 * c * (way + 1.0)


def test_concentration_outside_the_grid_is_zero():
    """Nodes answer for what is nearest to them and for nothing else."""
    silt = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=0.1, values=np.arange(8.0).reshape(2, 2, 2))
    points = np.array([[0.0, 0.0, 0.0], [0.09, 0.12, 0.1], [0.2, 0.0, 0.0], [-0.06, 0.0, 0.0]])
    assert concentration_at(silt, points).tolist() == [0.0, 7.0, 0.0, 0.0]


def test_tracers_go_by_the_midpoint():
    """In a flow that grows linearly the tracer's speed is that half a frame farther on."""

    class Growing:
        def velocity(self, points):
            return np.column_stack([3.0 * points[:, 0], np.zeros((len(points), 2))])

    starts = np.array([[0.1, 0.0, 1.0], [0.2, 0.0, 1.0]])
    speeds = tracer_speeds_m_s(Growing(), starts, Growing().velocity(starts), FRAME_S, 1.5)
    assert speeds == pytest.approx(3.0 * starts[:, 0] * (1 + 1.5 * FRAME_S))


def test_silt_outside_the_inner_grid_is_that_of_the_outer():
    """A ray and a point beyond the inner grid see the outer one's silt; within it the inner one alone counts."""
    outer = ScalarGrid(origin_W_m=np.array([-3.0, -2.5, -0.1]), spacing_m=0.2, values=np.full((31, 26, 9), 0.03))
    silt = ScalarGrid(
        origin_W_m=np.array([-0.8, -0.8, 0.5]), spacing_m=0.05, values=np.full((33, 33, 21), 0.02), outer=outer
    )
    points = np.array([[0.0, 0.0, 1.2], [1.5, 0.0, 1.2], [0.0, 0.0, 0.2], [9.0, 0.0, 1.0]])
    assert concentration_at(silt, points).tolist() == [0.02, 0.03, 0.03, 0.0]
    probes = TargetProbes(PYRAMID, np.random.default_rng(0))
    far = np.array([1.6, 0.0, 1.35])
    alone = ScalarGrid(origin_W_m=silt.origin_W_m, spacing_m=0.05, values=silt.values)
    assert probes.ray_optical_depth(LAWS, silt, far) > 1.5 * probes.ray_optical_depth(LAWS, alone, far)
