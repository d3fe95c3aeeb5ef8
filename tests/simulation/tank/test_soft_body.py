"""How the tank moves a soft or a loose target, against closed forms and a fine Runge-Kutta integration."""

from itertools import pairwise

import numpy as np
import pytest
from rods import BED_Z, rod, rod_mesh, together

from wakewise.core.errors import InputError
from wakewise.scene.targets import BendingModes, TissueProperties, place_on_bed
from wakewise.simulation.tank.soft_body import (
    SurfaceElements,
    TargetCompliance,
    TargetMotion,
    UnanchoredTarget,
    check_sway,
    drag_N,
    integrate_modes,
    slide_m_s,
    static_deflection_m,
    substeps,
)

WATER = 1000.0
DT = 0.05
R, LENGTH = 0.0025, 0.1


class Stream:
    """Even water that may change with time; a `Current` and, as the instant of a flow, one without jets."""

    def __init__(self, velocity, steady=True):
        self.of_time = velocity if callable(velocity) else lambda _: np.asarray(velocity, float)
        self.steady, self.time_s = steady, 0.0

    def velocity(self, points, time_s):
        return np.tile(self.of_time(time_s), (len(points), 1))

    def jets(self, points):
        return np.zeros_like(points)


def tissue(stiffness_Pa=1e6, damping=0.0, drag=1.2):
    return TissueProperties(stiffness_Pa=stiffness_Pa, density_kg_m3=WATER, drag=drag, damping=damping)


def swaying(target, flesh, stream, loose=None):
    yielding = TargetCompliance(drag=flesh.drag, sway=BendingModes.of(target, flesh, WATER), loose=loose)
    return TargetMotion(target, yielding, WATER, stream)


def go_on(body, stream, duration_s):
    """The first tip's way at each step of the water."""
    ways = []
    for k in range(round(duration_s / DT)):
        stream.time_s = (k + 1) * DT
        body.step(stream, DT)
        ways.append(body.tips_m.copy())
    return np.array(ways)


def test_the_drag_of_a_rod_is_that_of_its_width():
    """1/2 rho Cd times the width turned to the stream times its height, whatever the stream's direction."""
    pieces = SurfaceElements.of(rod(), None)
    for angle in np.deg2rad([0.0, 20.0, 65.0, 140.0]):
        passing = 0.2 * np.array([np.cos(angle), np.sin(angle), 0.0])
        force = drag_N(np.tile(passing, (len(pieces.stem), 1)), pieces.areas_m2, 1.2 * WATER)
        np.testing.assert_allclose(
            force[:2], 0.5 * 1.2 * WATER * 2 * R * LENGTH * 0.2 * passing[:2], rtol=0.05, atol=2e-4
        )


@pytest.mark.parametrize("speed", [0.02, 0.06])
def test_a_stream_bends_an_even_rod_by_w_l4_over_8_ei(speed):
    """The tip's way in a steady stream is the cantilever's of beam theory, within 4 %."""
    flesh = tissue()
    target = rod(R, R, LENGTH)
    sway = BendingModes.of(target, flesh, WATER)
    tips = static_deflection_m(SurfaceElements.of(target, sway), sway, flesh.drag * WATER, np.array([speed, 0.0, 0.0]))
    load = 0.5 * WATER * flesh.drag * 2 * R * speed**2
    way = load * LENGTH**4 / (8 * 1e6 * np.pi / 4 * R**4)
    assert way < 0.1 * LENGTH
    tip_W = tips[0] @ sway.axes_W[0]
    assert tip_W[0] == pytest.approx(way, rel=0.04)
    assert abs(tip_W[1]) < 0.03 * way


def test_a_target_begins_as_its_current_holds_it_and_stays_so():
    """In a steady stream nothing moves from the start on, and the pose is that of the stream."""
    stream = Stream([0.06, 0.0, 0.0])
    body = swaying(rod(), tissue(damping=0.1), stream)
    first = body.tips_m.copy()
    assert np.linalg.norm(first) > 1e-3
    ways = go_on(body, stream, 3.0)
    np.testing.assert_allclose(ways, np.broadcast_to(first, ways.shape), atol=1e-6)


def test_it_rings_at_its_natural_frequency_and_dies_away_as_damping_says():
    """Let go in still water by a little: period and decrement of 3.516 sqrt(EI / m L^4) and the tissue's damping."""
    flesh, still = tissue(damping=0.05), Stream([0.0, 0.0, 0.0])
    body = swaying(rod(), flesh, still)
    body.tips_m = np.array([[1e-5, 0.0]])  # so little that the water's drag does not count
    mass_per_m = 2 * WATER * np.pi * R**2
    frequency = 3.516 / (2 * np.pi) * np.sqrt(1e6 * np.pi / 4 * R**4 / (mass_per_m * LENGTH**4))
    ways = go_on(body, still, 6.0)[:, 0, 0]
    times = DT * (1 + np.arange(len(ways)))
    down = np.nonzero((ways[:-1] > 0) & (ways[1:] <= 0))[0]
    crossings = times[down] + DT * ways[down] / (ways[down] - ways[down + 1])
    assert np.diff(crossings).mean() == pytest.approx(1 / (frequency * np.sqrt(1 - 0.05**2)), rel=0.01)
    envelope = 1e-5 * np.exp(-0.05 * 2 * np.pi * frequency * times)
    assert np.all(np.abs(ways) < 1.02 * envelope / np.sqrt(1 - 0.05**2))
    assert np.abs(ways[-30:] / envelope[-30:]).max() > 0.8


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("tip", [0.002, 0.04])
def test_energy_never_grows_without_flow(damping, tip):
    """Whatever the swing, the sum of kinetic and elastic energy falls from step to step in still water."""
    target = place_on_bed("two", together(rod_mesh(R, R, 0.1), rod_mesh(0.005, 0.002, 0.12, at=(0.05, 0.0))), BED_Z)
    still = Stream([0.0, 0.0, 0.0])
    body = swaying(target, tissue(damping=damping), still)
    sway = body.sway
    body.tips_m, body.speeds_m_s = np.full((2, 2), tip), np.array([[0.1, -0.05], [0.0, 0.08]])

    def energy():
        q, v = body.tips_m, body.speeds_m_s
        return np.sum(0.5 * sway.mass_kg * v**2 + 0.5 * sway.stiffness_N_m * q**2 + 0.25 * sway.hardening_N_m3 * q**4)

    energies = [energy()]
    for _ in range(100):
        body.step(still, DT)
        energies.append(energy())
    assert np.all(np.diff(energies) < 1e-3 * energies[0])
    assert np.all(np.diff(energies[::10]) < 0.0)


def test_the_step_agrees_with_a_fine_runge_kutta():
    """In a gusty stream the tip is where RK4 with steps of half a millisecond has it, within 2 % of its way."""
    flesh, target = tissue(damping=0.1), rod(0.004, 0.002, 0.1)
    sway = BendingModes.of(target, flesh, WATER)
    pieces = SurfaceElements.of(target, sway)
    rng = np.random.default_rng(2)
    water = 0.06 * rng.standard_normal((41, 3)) * [1, 1, 0.2] + [0.08, 0.02, 0.0]

    def push(q, v, u):
        """The kernel's load, piece by piece as the room's text says it."""
        load = np.zeros(2)
        reach = np.zeros((len(pieces.stem), 2, 3))
        reach[:, :, :2] = sway.axes_W[0] * pieces.shape[:, :, None]
        reach[:, :, 2] = 2.0 * q * pieces.drop
        tilt = (q * pieces.slope) @ sway.axes_W[0]
        areas = pieces.areas_m2.copy()
        areas[:, 2] += np.sum(areas[:, :2] * tilt, axis=1)
        areas[:, :2] *= np.maximum(1.0 - 0.5 * np.sum(tilt**2, axis=1), 0.1)[:, None]
        passing = u - np.einsum("i,nij->nj", v, reach)
        share = 0.25 * WATER * flesh.drag * np.abs(np.sum(areas * passing, axis=1))
        load += np.einsum("n,nj,nij->i", share, passing, reach)
        return load

    def rate(state, u):
        q, v = state
        restoring = sway.stiffness_N_m[0] * q + sway.hardening_N_m3[0] * q**3 + sway.damping_N_s_m[0] * v
        return np.array([v, (push(q, v, u) - restoring) / sway.mass_kg[0]])

    state, fine = np.zeros((2, 2)), []
    for before, after in pairwise(water):
        h = DT / 100
        for k in range(100):
            at = [before + (k + share) / 100 * (after - before) for share in (0.0, 0.5, 1.0)]
            a = rate(state, at[0])
            b = rate(state + 0.5 * h * a, at[1])
            c = rate(state + 0.5 * h * b, at[1])
            d = rate(state + h * c, at[2])
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
        fine.append(state[0])
    tips, speeds, force = np.zeros((1, 2)), np.zeros((1, 2)), np.zeros(3)
    modes = np.stack(
        [sway.mass_kg, sway.stiffness_N_m, sway.hardening_N_m3, sway.damping_N_s_m, np.full((1, 2), 1.0)], axis=2
    )
    found = []
    for before, after in pairwise(water):
        integrate_modes(
            tips, speeds, force, modes, sway.axes_W, np.zeros((1, 2)), pieces.stem, pieces.areas_m2, pieces.shape,
            pieces.slope, pieces.drop, np.tile(before, (300, 1)), np.tile(after, (300, 1)), WATER * flesh.drag, DT,
            substeps(sway, DT),
        )  # fmt: skip
        found.append(tips[0].copy())
    way = np.linalg.norm(fine, axis=1).max()
    assert way > 0.003
    assert np.linalg.norm(np.array(found) - np.array(fine), axis=1).max() < 0.02 * way


def test_a_stiff_target_follows_at_once_and_stays_stable():
    """A million times as stiff as a soft one, it moves by less than a micrometre, and does not blow up."""
    flesh, stream = tissue(stiffness_Pa=1e12), Stream(lambda t: np.array([0.2 * np.sin(3 * t), 0, 0]), steady=False)
    body = swaying(rod(), flesh, stream)
    assert np.abs(go_on(body, stream, 5.0)).max() < 1e-6


def test_water_that_speeds_up_pushes_with_its_pressure_and_added_mass():
    """Where drag does not count, a steady acceleration a holds the rod as an even load of 2 rho A a would."""
    stream = Stream(lambda t: np.array([0.001 * t, 0.0, 0.0]), steady=False)
    body = swaying(rod(R, R, LENGTH), tissue(stiffness_Pa=2e4, drag=1e-6, damping=0.5), stream)
    way = 2 * WATER * np.pi * R**2 * 0.001 * LENGTH**4 / (8 * 2e4 * np.pi / 4 * R**4)
    tip = go_on(body, stream, 20.0)[-1, 0] @ body.sway.axes_W[0]
    assert tip[0] == pytest.approx(way, rel=0.02)
    assert abs(tip[1]) < 0.01 * way


@pytest.mark.parametrize(("speed", "slides"), [(0.20, False), (0.22, True)])
def test_a_loose_object_slides_only_if_drag_exceeds_friction(speed, slides):
    """It stays while drag is below mu W and is shifted along the stream above it."""
    target, stream = rod(), Stream([0.0, speed, 0.0])
    pieces = SurfaceElements.of(target, None)
    at_limit = drag_N(np.tile([0.0, 0.21, 0.0], (300, 1)), pieces.areas_m2, 1.2 * WATER)
    loose = UnanchoredTarget(weight_N=float(np.hypot(*at_limit[:2])) / 0.5, friction=0.5)
    body = TargetMotion(target, TargetCompliance(drag=1.2, loose=loose), WATER, stream)
    for _ in range(20):
        body.step(stream, DT)
    shifted = body.posture().shift_m
    if not slides:
        assert not shifted.any()
        return
    # It lets the water pass at the speed at which drag equals friction.
    assert shifted[1] == pytest.approx(20 * DT * (speed - 0.21), rel=0.05)
    assert abs(shifted[0]) < 0.1 * shifted[1]


def test_sliding_stops_where_friction_holds():
    """At the limit itself nothing slides, and far above it the object goes with the water."""
    assert not slide_m_s(np.array([0.3, 0.4]), np.array([0.1, 0.1]), 0.5).any()
    fast = slide_m_s(np.array([3e6, 4e6]), np.array([0.06, 0.08]), 0.5)
    np.testing.assert_allclose(fast, [0.06, 0.08], rtol=1e-3)


def test_too_stiff_and_too_soft_are_refused_with_the_figures():
    """Above the frequency at which the water is known, and where the current bends it beyond half."""
    stiff, soft, good = (BendingModes.of(rod(), tissue(stiffness_Pa=e), WATER) for e in (1e9, 3e3, 1e6))
    with pytest.raises(InputError, match=r"rod swings at .* Hz or more.*too stiff"):
        check_sway(rod(), stiff, 1.2, np.zeros(3), WATER, DT)
    with pytest.raises(InputError, match=r"current of 0.1 m/s bends rod.*too soft"):
        check_sway(rod(), soft, 1.2, np.array([0.1, 0.0, 0.0]), WATER, DT)
    check_sway(rod(), good, 1.2, np.array([0.1, 0.0, 0.0]), WATER, DT)


class Pushed(Stream):
    """A stream, and jets that add to it."""

    def jets(self, points):
        return np.tile([0.0, 0.05, 0.0], (len(points), 1))


def test_what_the_wash_adds_is_told_apart_from_the_current():
    """None of it in a current alone, however it sways; all that jets add to the same current with them."""
    stream = Stream(lambda t: np.array([0.1 * np.sin(2.0 * t), 0.02, 0.0]), steady=False)
    alone = swaying(rod(), tissue(), stream)
    go_on(alone, stream, 3.0)
    assert alone.posture().sway_m > 0.0
    assert alone.posture().sway_wash_m == 0.0
    pushed = swaying(rod(), tissue(), stream)
    go_on(pushed, Pushed(lambda t: np.array([0.1 * np.sin(2.0 * t), 0.02, 0.0]), steady=False), 3.0)
    np.testing.assert_array_equal(pushed.alone_m, alone.tips_m)
    far = np.linalg.norm(pushed.tips_m - alone.tips_m)
    assert 0.0 < pushed.posture().sway_wash_m == pytest.approx(0.4 * far, rel=0.35)


def test_the_drag_on_the_whole_is_told():
    """A loose rod that is held has the drag of its width; a stem that has come to rest has nearly as much."""
    stream = Stream([0.1, 0.0, 0.0])
    held = UnanchoredTarget(weight_N=1e3, friction=0.6)
    desired = 0.5 * 1.2 * WATER * 2 * R * LENGTH * 0.1**2
    for body in (
        TargetMotion(rod(), TargetCompliance(drag=1.2, loose=held), WATER, stream),
        swaying(rod(), tissue(), stream),
    ):
        assert body.posture().drag_N == 0.0  # no step has been made
        body.step(stream, DT)
        assert body.posture().drag_N == pytest.approx(desired, rel=0.05)


def test_the_posture_tells_of_the_surface():
    """Root mean square, peak and mean way are those of a bent rod; a rigid one that lies loose has none."""
    stream = Stream([0.1, 0.0, 0.0])
    body = swaying(rod(), tissue(), stream)
    posture = body.posture()
    assert posture.sway_peak_m == pytest.approx(np.linalg.norm(posture.tips_m), rel=0.05)
    assert posture.sway_mean_W_m[0] < posture.sway_m < posture.sway_peak_m
    assert posture.sway_mean_W_m[0] > 0.3 * posture.sway_peak_m
    assert posture.target_stress_Pa > 1e3
    lying = TargetMotion(
        rod(), TargetCompliance(drag=1.2, loose=UnanchoredTarget(weight_N=1.0, friction=0.6)), WATER, stream
    ).posture()
    assert lying.sway_m == lying.sway_peak_m == lying.target_stress_Pa == 0.0
    assert lying.tips_m.shape == (0, 2)
