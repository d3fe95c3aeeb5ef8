"""Jets that cross: where their water goes, what is kept of it, and the fan against the lattice's."""

import math

import numpy as np
import pytest

from wakewise.simulation.lattice import load_mean_field
from wakewise.simulation.water.colliding_jets import RAYS, ray_azimuths, spread_crossing_jets
from wakewise.simulation.water.parcels import Parcels
from wakewise.simulation.water.round_jet_closure import JetSpreading
from wakewise.simulation.water.water import Water
from wakewise_paper.lattice_reference.crossing_jets import DATA, crossing_place, load_crossing
from wakewise_paper.lattice_reference.reference_cases import find_case

D_M = 0.06
AREA_M2 = math.pi * D_M**2 / 4
EXIT_M_S = math.sqrt(1.0 / (1000.0 * AREA_M2))
STREAMS = 4


def _pair(angle_deg, strengths=(1e-3, 1e-3), gap=0.04, streams=(0, 2), more=0):
    """Two parcels that come to a crossing at x = 0 from `gap` before it, one along x, and room for so many more."""
    turn = math.radians(angle_deg)
    ways = np.array([[1.0, 0.0, 0.0], [math.cos(turn), math.sin(turn), 0.0]])
    return Parcels.sent(
        -gap * ways,
        np.array(strengths)[:, None] * ways,
        np.full(2, 0.05),
        np.full(2, D_M),
        np.array(streams),
        np.ones((2, 3)),
        np.zeros((2, 3)),
        np.full(2, 0.5),
    ).with_room(2 + RAYS + more)


@pytest.mark.parametrize("half_angle_deg", [10.0, 30.0, 45.0, 60.0])
def test_rays_stand_for_equal_shares_of_the_law(half_angle_deg):
    """Between neighbouring rays lies one share of w, found by summing w itself; its mean cosine is cos alpha."""
    lean = math.cos(math.radians(half_angle_deg))
    phi = np.linspace(-math.pi, math.pi, 400001)
    w = math.sin(math.radians(half_angle_deg)) ** 3 / (1 - lean * np.cos(phi)) ** 2
    assert np.trapezoid(w, phi) / (2 * math.pi) == pytest.approx(1.0, rel=1e-6)
    assert np.trapezoid(w * np.cos(phi), phi) / (2 * math.pi) == pytest.approx(lean, rel=1e-6)
    rays = np.empty((RAYS, 2))
    ray_azimuths(lean, 0.3, rays)
    azimuths = np.arctan2(rays[:, 1], rays[:, 0])
    up_to = np.interp(azimuths, phi, np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(phi))]))
    assert np.diff(np.sort(up_to)) == pytest.approx(np.full(RAYS - 1, 2 * math.pi / RAYS), abs=1e-3)


@pytest.mark.parametrize("angle_deg", [21.0, 60.0, 90.0, 119.0])
@pytest.mark.parametrize("weaker", [1e-3, 0.4e-3])
def test_a_crossing_keeps_momentum(angle_deg, weaker):
    """The impulse of rays and rest is that of the two before, to rounding, however strong and at whatever angle."""
    jets = _pair(angle_deg, (1e-3, weaker))
    before = jets.impulse[:2].sum(axis=0)
    count, met = spread_crossing_jets(jets, 2, STREAMS, 5)
    assert met == 6 and count == RAYS + (weaker < 1e-3)
    assert jets.impulse[:count].sum(axis=0) == pytest.approx(before, abs=1e-15)
    out_of_plane = jets.impulse[:count, 2]
    assert out_of_plane.max() > 0.0 > out_of_plane.min()


def test_rays_run_out_in_the_plane_midway():
    """What was opposed is gone from every ray; the more the jets oppose each other, the more leaves their plane."""
    risen = []
    for angle_deg in (30.0, 60.0, 90.0, 115.0):
        jets = _pair(angle_deg)
        count, _ = spread_crossing_jets(jets, 2, STREAMS, 0)
        turn = 0.5 * math.radians(angle_deg)
        normal = np.array([math.sin(turn), -math.cos(turn), 0.0])
        assert np.abs(jets.impulse[:count] @ normal).max() < 1e-15
        risen.append(np.abs(jets.impulse[:count, 2]).sum())
    assert np.all(np.diff(risen) > 0.0)


@pytest.mark.parametrize(
    ("angle_deg", "gap", "streams"),
    [(15.0, 0.04, (0, 2)), (125.0, 0.04, (0, 2)), (90.0, -0.04, (0, 2)), (90.0, 0.3, (0, 2)), (90.0, 0.04, (2, 2)),
     (90.0, 0.04, (0, STREAMS)), (90.0, 0.04, (0, STREAMS + 3))],
    ids=["nearly parallel", "head-on", "gone apart", "far", "one jet", "the hull's wake", "a fan"],
)  # fmt: skip
def test_others_do_not_cross(angle_deg, gap, streams):
    """They go on as they were."""
    jets = _pair(angle_deg, gap=gap, streams=streams)
    kept = jets.impulse[:2].copy()
    assert spread_crossing_jets(jets, 2, STREAMS, 0) == (2, 0)
    assert np.array_equal(jets.impulse[:2], kept)


def test_without_room_a_crossing_waits():
    """Where the rays would not fit, the jets are left as they are."""
    jets = _pair(90.0, more=-1)
    assert spread_crossing_jets(jets, 2, STREAMS, 0) == (2, 0)


def _crossing(width, points_D, name="crossing"):
    """Mean flow of a lattice's case by parcels, over U0, at points from the crossing, in D; and the water."""
    water = Water(
        np.full(2, AREA_M2),
        density_kg_m3=1000.0,
        bed_z_m=math.inf,
        rng=np.random.default_rng(0),
        turbulence=0.25,
        spreading=JetSpreading.of_width(width),
        rest_speed_m_s=0.0,
    )
    case = find_case(name)
    disks = np.array([jet.position_D for jet in case.jets]) * D_M
    axes, impulses, dt_s = -np.array([jet.direction for jet in case.jets]), np.array([[0.05, 0.0], [0.05, 0.0]]), 0.05
    points, u, steps = (crossing_place(case) + points_D) * D_M, np.zeros(points_D.shape), 0
    while water.time_s < 120 * D_M / EXIT_M_S:  # as the lattice: 40 D/U0 to develop, 80 to average
        water.step(dt_s, disks, disks, axes, impulses)
        if water.time_s > 40 * D_M / EXIT_M_S:
            u, steps = u + water.velocity(points), steps + 1
    return u / steps / EXIT_M_S, water


def test_momentum_of_crossing_jets_stays_in_the_water():
    """Of two jets of 1 N at right angles 1 N s per second and axis is in the parcels, and nothing out of the plane."""
    _, water = _crossing(0.094, np.zeros((1, 3)))
    momentum = 1000.0 * water.parcels.impulse_m4_s.sum(axis=0) / water.time_s
    assert momentum == pytest.approx([1.0, 1.0, 0.0], abs=0.02)


def test_crossing_jets_fan_out_as_in_the_lattice():
    """At right angles, above the jets' plane water is 0.5 to 1.6 times as fast as in the lattice; the axis is slower.

    The lattice's single jet is wider than a round jet, growth 0.13, and where the two cross it has 0.57 U0 left, not 1:
    so parcels of its width are held against it, and parcels of a round jet against each one's own single jet. Before
    there were fans, the axis had 2.0 to 2.5 times the lattice's speed and 2 D above it there was next to none.
    """
    field = load_crossing()
    behind = (field.away_D >= 1.0) & (field.away_D <= 6.0)
    above, _ = field.points_D()
    along = np.array([1.0, 1.0, 0.0]) / math.sqrt(2)
    wide, round_ = (
        _crossing(width, above[behind].reshape(-1, 3))[0].reshape(*above[behind].shape) for width in (0.13, 0.094)
    )
    axis = (wide @ along)[:, 0] / field.along_above[behind, 0]
    assert np.all((axis > 0.8) & (axis < 1.6))
    speed = np.hypot(wide @ along, wide[..., 2])
    theirs = np.hypot(field.along_above, field.out_above)[behind]
    up = (field.out_D >= 1.0) & (field.out_D <= 2.0)
    ratio = speed[:, up].mean(axis=1) / theirs[:, up].mean(axis=1)
    assert np.all((ratio > 0.5) & (ratio < 1.6))
    # Out of the plane it goes, on both sides of the axis alike.
    assert wide[0, field.out_D == 2.0, 2] > 0.5 * field.out_above[behind][0, field.out_D == 2.0]
    # Each by its own jet's speed at the crossing, the two agree on the axis.
    single = load_mean_field("free").at(np.array([6.0]), np.zeros(1), ("axial",))[0, 0]
    own = (round_ @ along)[:, 0] / (field.along_above[behind, 0] / single)
    assert np.all((own > 0.8) & (own < 1.3))


@pytest.mark.parametrize(("name", "fan"), [("crossing-40", (0.4, 1.1)), ("crossing-110", (0.9, 1.9))])
def test_regression_of_fans_at_other_angles(name, fan):
    """Not as in the lattice: the axis 1.1 to 1.7 times as fast; the fan half as fast at 40 deg, up to twice at 110.

    With fans nothing is as wrong as without: at 40 degrees two jets that merge by momentum have no fan at all.
    """
    field = load_crossing(DATA / f"{name}.npz")
    behind, up = (field.away_D >= 1.0) & (field.away_D <= 6.0), (field.out_D >= 1.0) & (field.out_D <= 2.0)
    above, _ = field.points_D()
    u = _crossing(0.13, above[behind].reshape(-1, 3), name)[0].reshape(above[behind].shape)
    axis = u[:, 0, 0] / field.along_above[behind, 0]
    assert np.all((axis > 1.1) & (axis < 1.7))
    theirs = np.hypot(field.along_above, field.out_above)[behind]
    ratio = np.hypot(u[..., 0], u[..., 2])[:, up].mean(axis=1) / theirs[:, up].mean(axis=1)
    assert np.all((ratio > fan[0]) & (ratio < fan[1])), ratio
