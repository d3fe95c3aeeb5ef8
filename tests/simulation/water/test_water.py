"""The tank's water against the laws of turbulent round jets, and against itself.

Laws (Albertson 1950; Hussein, Capp and George 1994), M = thrust / density:
    centre line   U x / sqrt(M) = 6.0 to 7.7 beyond ten diameters;     half width   0.09 to 0.10 x
    level         four times the thrust, twice the speed;              front        2.57 M^(1/4) t^(1/2), 15 %
"""

import math

import numpy as np
import pytest
from round_jet_reference import travel

from wakewise.simulation.tank.grains import friction_velocity_m_s
from wakewise.simulation.tank.sediment import SHEAR_HEIGHT_M
from wakewise.simulation.water import induction
from wakewise.simulation.water.parcels import Parcels, merged
from wakewise.simulation.water.water import Water

D_M = 0.06
AREA_M2 = math.pi * D_M**2 / 4
DENSITY = 998.0


def _water(n=1, seed=0, **options):
    options.setdefault("bed_z_m", math.inf)
    return Water(np.full(n, AREA_M2), density_kg_m3=DENSITY, rng=np.random.default_rng(seed), **options)


def _run(water, seconds, thrusts_N, origins=((0.0, 0.0, 0.0),), jets=((1.0, 0.0, 0.0),), dt_s=0.05):
    origins, axes = np.array(origins, dtype=float), -np.array(jets, dtype=float)
    T = np.array(thrusts_N, dtype=float)
    impulses = np.column_stack([np.maximum(T, 0), np.maximum(-T, 0)]) * dt_s
    for _ in range(round(seconds / dt_s)):
        water.step(dt_s, origins, origins, axes, impulses)
    return water


def _axis_speed(water, x):
    x = np.atleast_1d(x)
    return water.velocity(np.column_stack([x, 0 * x, 0 * x]))[:, 0]


@pytest.fixture(scope="module")
def steady():
    return _run(_water(), 12.0, [1.0])


@pytest.mark.parametrize("thrust_N", [0.1, 1.0, 5.0])
def test_speed_on_the_axis_falls_as_measured(thrust_N):
    """U x / sqrt(M) lies in 6.0 to 7.7 beyond ten diameters, for weak and strong jets."""
    water = _run(_water(), 12.0 / math.sqrt(thrust_N), [thrust_N])
    x = np.array([0.6, 0.7, 0.8, 1.0])
    law = _axis_speed(water, x) * x / math.sqrt(thrust_N / DENSITY)
    assert np.all((law > 6.0) & (law < 7.7))


def test_the_core_has_the_exit_speed(steady):
    """Within five diameters the axis moves at sqrt(T/(rho A)), within 3 %."""
    assert _axis_speed(steady, np.array([0.1, 0.2, 0.3])) == pytest.approx(
        math.sqrt(1.0 / (DENSITY * AREA_M2)), rel=0.03
    )


def test_half_width_is_as_measured(steady):
    """The speed is half of the axis' at 0.09 to 0.10 of the distance."""
    for x in (0.6, 0.8, 1.0):
        r = np.linspace(0, 0.25 * x, 200)
        u = steady.velocity(np.column_stack([np.full(200, x), r, 0 * r]))[:, 0]
        assert 0.09 <= np.interp(-0.5 * u[0], -u, r) / x <= 0.10


def test_four_times_the_thrust_doubles_the_speed(steady):
    """Flows are alike when time runs twice as fast."""
    strong = _run(_water(), 6.0, [4.0])
    x = np.array([0.3, 0.6, 1.0])
    assert _axis_speed(strong, x) == pytest.approx(2 * _axis_speed(steady, x), rel=0.02)


def test_momentum_through_a_plane_is_the_thrust(steady):
    """The integral of rho u^2 over a plane across the jet is the thrust, within 10 %."""
    for x in (0.6, 0.9):
        r = np.linspace(0, 0.5 * x, 400)
        u = steady.velocity(np.column_stack([np.full(400, x), r, 0 * r]))[:, 0]
        assert np.trapezoid(DENSITY * u**2 * 2 * np.pi * r, r) == pytest.approx(1.0, rel=0.10)


@pytest.mark.parametrize("time_s", [2.0, 4.0, 8.0])
def test_the_front_advances_with_the_root_of_time(time_s):
    """The speed is half of the steady one at 2.57 M^(1/4) t^(1/2), within 12 %."""
    M, x = 1.0 / DENSITY, np.linspace(0.02, 3.0, 400)
    share = _axis_speed(_run(_water(), time_s, [1.0]), x) * x / (7.05 * math.sqrt(M))
    share = np.where(x < 0.36, 1.0, share)
    assert x[np.nonzero(share > 0.5)[0][-1]] == pytest.approx(2.57 * M**0.25 * math.sqrt(time_s), rel=0.12)


def test_water_far_away_is_still_until_the_jet_arrives():
    """One second after the start a point 1 m down the jet has less than a twentieth of its later speed."""
    early, late = _run(_water(), 1.0, [1.0]), _run(_water(), 12.0, [1.0])
    assert _axis_speed(early, 1.0)[0] < 0.05 * _axis_speed(late, 1.0)[0]


def test_reverse_thrust_turns_the_jet_round(steady):
    """Thrust -T sends the mirror image of the jet of thrust T, to the single precision of the sums."""
    reverse = _run(_water(), 12.0, [-1.0])
    x = np.array([0.3, 0.8])
    assert _axis_speed(reverse, -x) == pytest.approx(-_axis_speed(steady, x), rel=1e-6)


def test_half_the_flow_step_gives_the_same_jet(steady):
    """A step of 0.05 s is fine enough: 0.02 s changes speeds by less than 2 %."""
    fine = _run(_water(), 12.0, [1.0], dt_s=0.02)
    x = np.array([0.3, 0.5, 0.8, 1.0])
    assert _axis_speed(fine, x) == pytest.approx(_axis_speed(steady, x), rel=0.02)


def test_a_thruster_adrift_in_a_current_makes_the_jet_of_still_water(steady):
    """Galilean invariance: seen from the current, nothing has changed."""
    current = np.array([0.0, 0.1, 0.0])
    water, dt_s = _water(current_W_m_s=current), 0.05
    for k in range(240):
        before, after = (current[None] * dt_s * n for n in (k, k + 1))
        water.step(dt_s, before, after, np.array([[-1.0, 0.0, 0.0]]), np.array([[dt_s, 0.0]]))
    points = np.array([[0.3, 0.0, 0.0], [0.8, 0.05, 0.02]])
    moved = water.excess_velocity(points + current * 12.0)
    assert moved == pytest.approx(steady.excess_velocity(points), rel=1e-4, abs=1e-6)


def test_two_jets_add_momentum_and_not_speed(steady):
    """Far down two jets 8 cm apart, the middle moves at sqrt 2 and not 2 times one jet, within 10 %."""
    pair = _run(_water(2), 14.0, [1.0, 1.0], origins=[[0, 0.04, 0], [0, -0.04, 0]], jets=[[1, 0, 0]] * 2)
    assert _axis_speed(pair, 1.2)[0] / _axis_speed(steady, 1.2)[0] == pytest.approx(math.sqrt(2), rel=0.10)


def test_a_jet_that_strikes_the_bed_runs_out_along_it():
    """Below a 1 N jet 0.5 m up, the bed's speed is within 20 % of 1.16 sqrt(M)/r, and no water passes the bed."""
    water = _run(_water(bed_z_m=1.5), 15.0, [1.0], origins=[[0, 0, 1.0]], jets=[[0, 0, 1]])
    r = np.array([0.15, 0.2, 0.3, 0.4])
    u = water.velocity(np.column_stack([r, 0 * r, 0 * r + 1.5]))
    assert u[:, 0] * r / math.sqrt(1 / DENSITY) == pytest.approx(np.full(4, 1.16), rel=0.20)
    assert np.abs(u[:, 2]).max() < 1e-12


def test_stress_under_an_impinging_jet_is_as_measured():
    """The greatest mean bed stress is within 25 % of 0.16 rho U0^2 (D/H)^2 (Beltaos and Rajaratnam 1974), at 0.14 H."""
    H, r = 0.5, np.linspace(0.02, 0.3, 57)
    water = _run(_water(bed_z_m=1.5), 8.0, [1.0], origins=[[0, 0, 1.5 - H]], jets=[[0, 0, 1]])
    stress = []
    for _ in range(100):
        _run(water, 0.05, [1.0], origins=[[0, 0, 1.5 - H]], jets=[[0, 0, 1]])
        speed = np.linalg.norm(water.velocity(np.column_stack([r, 0 * r, 0 * r + 1.5])), axis=1)
        stress.append(DENSITY * friction_velocity_m_s(speed, SHEAR_HEIGHT_M, 20e-6) ** 2)
    mean = np.mean(stress, axis=0)
    assert mean.max() == pytest.approx(0.16 * (1.0 / AREA_M2) * (D_M / H) ** 2, rel=0.25)
    assert r[mean.argmax()] / H == pytest.approx(0.14, abs=0.05)


def test_turbulence_has_its_level_and_leaves_the_mean():
    """The axis fluctuates by 0.25 of its mean, within 40 %, while the mean keeps the law."""
    water = _run(_water(turbulence=0.25), 8.0, [1.0])
    samples = []
    for _ in range(120):
        _run(water, 0.2, [1.0])
        samples.append(_axis_speed(water, np.array([0.7, 0.8, 0.9])))
    u, x = np.array(samples), np.array([0.7, 0.8, 0.9])
    assert (u.std(axis=0) / u.mean(axis=0)).mean() == pytest.approx(0.25, rel=0.40)
    assert np.all(np.abs(u.mean(axis=0) * x / math.sqrt(1 / DENSITY) - 6.85) < 0.85)


def test_merging_conserves_impulse():
    """Merged parcels are fewer and carry the same impulse, and opposite parcels are left alone."""
    rng = np.random.default_rng(0)
    n = 60
    position = np.column_stack([np.linspace(0, 0.4, n), np.zeros((n, 2))])
    impulse = np.array([1.0, 0.0, 0.0]) + 0.1 * rng.normal(size=(n, 3))
    row = Parcels.sent(
        position,
        impulse,
        np.full(n, 0.05),
        np.full(n, D_M),
        np.zeros(n, dtype=np.int64),
        rng.normal(size=(n, 3)),
        np.zeros((n, 3)),
    )
    fewer = merged(row, 0.5)
    assert fewer.count < 0.6 * n
    assert fewer.impulse_m4_s.sum(axis=0) == pytest.approx(impulse.sum(axis=0), rel=1e-12)
    back = Parcels.sent(
        position,
        impulse * (-1.0) ** np.arange(n)[:, None],
        row.sigma_m,
        row.diameter_m,
        row.stream,
        row.gust,
        row.disk_m_s,
    )
    assert merged(back, 0.5).count == n


def test_impulse_is_accounted_for():
    """What the thrusters gave is in the water, retired, struck, gone, or about to be sent."""
    water = _run(_water(bed_z_m=1.5, half_size_m=(1.0, 1.0)), 30.0, [0.5], origins=[[0, 0, 1.0]], jets=[[0.6, 0, 0.8]])
    counts = water.counts
    held = np.linalg.norm(water.parcels.impulse_m4_s, axis=1).sum() * DENSITY
    # A row's parcels are parallel, so merging keeps the sum of lengths too; up to one parcel waits at the disk.
    assert held + counts.struck_N_s + counts.retired_N_s == pytest.approx(15.0, abs=0.1)
    assert counts.struck_N_s > 1.0


def test_too_many_parcels_are_coarsened_and_said_so(caplog):
    """Above the limit rows are made coarser, which is logged and counted."""
    water = _run(_water(max_parcels=20), 10.0, [1.0])
    assert water.counts.parcels <= 20
    assert water.counts.forced_merges > 0
    assert "more than 20 parcels" in caplog.text


def test_the_same_seed_gives_the_same_bytes():
    """Two waters from one seed are identical; another seed differs."""
    fields = []
    for seed in (1, 1, 2):
        water = _run(_water(seed=seed, turbulence=0.25, bed_z_m=1.5), 4.0, [1.0], jets=[[0, 0, 1]])
        fields.append(water.velocity(np.random.default_rng(0).uniform(0, 1.4, (50, 3))).tobytes())
    assert fields[0] == fields[1] != fields[2]


def test_threads_do_not_change_a_byte(monkeypatch):
    """Free jets and wall jets together give the same velocities on one thread and on four."""
    water = _run(
        _water(2, turbulence=0.25, bed_z_m=1.5, half_size_m=(1.0, 1.0)),
        10.0,
        [1.0, 0.7],
        origins=[[0, 0, 1.0], [0.3, 0.2, 0.7]],
        jets=[[0.3, 0.1, 0.95], [-0.6, 0.0, 0.8]],
    )
    points = np.random.default_rng(2).uniform([-0.9, -0.9, 0.4], [0.9, 0.9, 1.5], (1501, 3))
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 10**12)
    alone = water.velocity(points)
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 1)
    monkeypatch.setattr(induction, "cores", lambda: 4)
    assert water.velocity(points).tobytes() == alone.tobytes()
    assert water.rings.count > 0


def test_travel_is_the_integral_of_the_closure():
    """One long step equals a thousand short ones through core and far jet, with the speed that belongs to each size."""
    exit_speed, D = 1.0, np.array([D_M])
    first = D_M / math.sqrt(8)

    def speed(sigma):
        return np.where(sigma < D_M / 2, exit_speed, exit_speed * (D_M / 2) / sigma)

    path, sigma = travel(np.array([first]), D, np.array([exit_speed]), 1.5)
    short, s = 0.0, np.array([first])
    for _ in range(1000):
        d, s = travel(s, D, speed(s), 1.5e-3)
        short += d[0]
    assert path[0] == pytest.approx(short, rel=1e-6)
    assert sigma[0] == pytest.approx(s[0], rel=1e-6)
