"""The tank as a whole: one clock, honest excess, determinism, silt in the picture, refusals."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Plant
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Mesh, place_on_bed
from wakewise.simulation.tank import Tank, TankSettings
from wakewise.simulation.tank.settings import SiltSettings
from wakewise.simulation.tank.water_truth import bed_points, surface_points, water_points

VEHICLE = load_vehicle("paper")
# A pyramid of 0.15 m: four sides and a foot.
PYRAMID = place_on_bed(
    "pyramid",
    Mesh(
        np.array([[0.07, 0.07, 0], [-0.07, 0.07, 0], [-0.07, -0.07, 0], [0.07, -0.07, 0], [0, 0, 0.15]]),
        np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]]),
    ),
    1.5,
)
CLEAN = {"load_kg_m2": 0.0}
HOLD_DOWN = VEHICLE.null_space @ np.full(VEHICLE.null_space.shape[1], 6.0)


def _tank(p=(0.0, 0.0, 1.0), seed=0, **settings):
    settings.setdefault("current", {"velocity_m_s": (0.0, 0.0, 0.0)})
    start = BodyState(X_WB=Pose(np.array(p, dtype=float)))
    return Tank(VEHICLE, PYRAMID, TankSettings(**settings), start, np.random.default_rng(seed))


def _fly(tank, seconds, thrusts=HOLD_DOWN, dt_s=0.02):
    heard = []
    for _ in range(round(seconds / dt_s)):
        heard += tank.step(thrusts, dt_s)
    return heard


def test_a_tank_is_a_plant():
    """It satisfies the Protocol that the loop flies, and its clock adds up."""
    tank: Plant = _tank()
    heard = _fly(tank, 1.0)
    assert tank.time_s == pytest.approx(1.0)
    assert len(heard) > 100
    assert all(0.0 < m.time_s <= 1.0 + 1e-9 for m in heard)


def test_without_thrust_nothing_is_stirred():
    """A current alone moves water but gives no excess and lifts no silt."""
    tank = _tank(current={"velocity_m_s": (0.03, 0.02, 0.0)})
    _fly(tank, 1.0, np.zeros(8))
    measure = tank.measure()
    assert measure.target_speed_p95_m_s == 0.0
    assert measure.bed_speed_p95_m_s == 0.0
    assert measure.turbidity_per_m == 0.0
    assert tank.water.velocity(np.array([[0.0, 0.0, 1.0]])) == pytest.approx(np.array([[0.03, 0.02, 0.0]]))


def test_downwash_stirs_the_bed_and_clouds_the_water():
    """Thrusters fighting each other above a silty bed raise silt at the target; a clean bed stays clear; mass stays."""
    silty, clean = _tank(silt={"load_kg_m2": 1.0}), _tank(silt=CLEAN)
    mass = silty.silt.total_kg
    for tank in (silty, clean):
        _fly(tank, 4.0)
    assert silty.measure().bed_speed_p95_m_s > 0.02
    assert silty.silt.suspended_kg > 0.0
    assert silty.concentration_grid().values.max() > 0.0
    assert clean.concentration_grid().values.max() == 0.0
    assert silty.silt.total_kg == pytest.approx(mass, rel=1e-9)
    assert silty.concentration_grid().values.shape == (33, 33, 21)


def test_the_same_seed_gives_the_same_record():
    """State, measurements, water and silt repeat to the byte; another seed differs."""
    records = []
    for seed in (1, 1, 2):
        tank = _tank(seed=seed)
        heard = _fly(tank, 2.0)
        parts = [tank.state.X_WB.p_m, tank.state.nu_B, tank.excess_velocity(np.array([[0.1, 0.0, 1.2]]))]
        parts += [tank.concentration_grid().values, np.array([m.depth_m for m in heard if m.depth_m is not None])]
        records.append(b"".join(np.ascontiguousarray(part).tobytes() for part in parts))
    assert records[0] == records[1] != records[2]


def test_the_control_rate_does_not_change_the_physics():
    """Held thrusts give the same flight at 50 Hz and at 20 Hz, apart from where samples split the steps."""
    fine, coarse = _tank(jets={"turbulence": 0.0}), _tank(jets={"turbulence": 0.0})
    _fly(fine, 2.0, dt_s=0.02)
    _fly(coarse, 2.0, dt_s=0.05)
    assert fine.state.X_WB.p_m == pytest.approx(coarse.state.X_WB.p_m, abs=1e-6)
    points = np.array([[0.2, 0.1, 1.3]])
    assert fine.excess_velocity(points) == pytest.approx(coarse.excess_velocity(points), rel=1e-3, abs=1e-6)


def test_probes_are_on_the_surface_and_even():
    """Surface points lie on the pyramid's sides in proportion to area; bed and water points lie where they should."""
    points = surface_points(PYRAMID, 400, np.random.default_rng(0))
    across = np.abs(points[:, :2]).max(axis=1)
    assert across == pytest.approx(0.07 * (points[:, 2] - 1.35) / 0.15, abs=1e-9)
    quadrant = np.bincount((points[:, 0] > points[:, 1]) * 2 + (points[:, 0] > -points[:, 1]), minlength=4)
    assert np.all(np.abs(quadrant - 100) <= 2)
    bed = bed_points(PYRAMID.centre_W_m, 1.5, 0.3)
    assert np.all(np.hypot(bed[:, 0], bed[:, 1]) <= 0.3)
    assert np.all((bed[:, 2] >= 1.48) & (bed[:, 2] <= 1.49))
    water = water_points(PYRAMID, 0.3)
    assert len(water) > 300
    assert np.all(np.linalg.norm(water - PYRAMID.centre_W_m, axis=1) <= 0.3)


def test_inflow_takes_thrust_from_a_thruster_in_a_stream():
    """With the option on, thrusters held in a stream along their jets give less than they do without it."""
    settings = {"current": {"velocity_m_s": (0.0, 0.0, 0.15)}, "silt": CLEAN}
    plain, lossy = (_tank(jets={"turbulence": 0.0, "inflow_loss": lossy}, **settings) for lossy in (False, True))
    # Forces up, jets down, as the stream runs.
    up = np.where(np.abs(VEHICLE.thruster_axes_B[:, 2]) > 0.9, -2.0 * np.sign(VEHICLE.thruster_axes_B[:, 2]), 0.0)
    for tank in (plain, lossy):
        _fly(tank, 0.3, up)
    strong = np.abs(up) > 0
    assert np.all(np.abs(lossy.thrusts_N[strong]) < 0.95 * np.abs(plain.thrusts_N[strong]))
    assert np.all(np.abs(lossy.thrusts_N[strong]) > 0.3 * np.abs(plain.thrusts_N[strong]))


def test_a_dead_thruster_stops_at_its_time():
    """Its thrust dies with its lag and it sends no jet any more; the others go on."""
    tank = _tank(failures=({"thruster": 2, "at_s": 1.0},), silt=CLEAN)
    _fly(tank, 0.9, np.full(8, 0.5))
    assert tank.thrusts_N[1] == pytest.approx(0.5, rel=0.05)
    _fly(tank, 1.6, np.full(8, 0.5))
    assert abs(tank.thrusts_N[1]) < 0.005
    assert tank.thrusts_N[0] == pytest.approx(0.5, rel=0.05)


def test_kinds_of_water():
    """Clear has no grain, silt a bed of it, caco3-50mg sand in the water that is said to sink; fields given win."""
    assert SiltSettings() == SiltSettings(kind="silt")
    assert SiltSettings(kind="clear").load_kg_m2 == 0.0
    sand = SiltSettings(kind="caco3-50mg")
    assert (sand.suspended_mg_l, sand.grain_m, sand.load_kg_m2) == (50.0, 3e-4, 0.0)
    assert SiltSettings(kind="clear", load_kg_m2=0.3).load_kg_m2 == 0.3
    assert SiltSettings.model_validate(sand.model_dump()) == sand


def test_suspended_sand_is_said_to_sink(caplog):
    """The preset of 50 mg/L dims the picture at first, warns that it will not last, and keeps its mass."""
    tank = _tank(silt={"kind": "caco3-50mg"})
    assert "all lie on the bed after 33 s" in caplog.text
    first = tank.measure()
    assert first.turbidity_per_m == pytest.approx(0.18, rel=0.3)
    assert first.ray_optical_depth > 0.0
    afloat = tank.silt.suspended_kg
    _fly(tank, 3.0, np.zeros(8))
    # An even cloud stays even while it sinks: what has gone is its top, w_s t of the depth.
    assert tank.silt.suspended_kg / afloat == pytest.approx(1 - 3.0 * tank.silt.laws.settling_m_s / 1.5, abs=0.02)
    assert tank.silt.mass_error_rel < 1e-9


def test_waves_move_the_vehicle_and_are_no_excess():
    """Under waves a vehicle without thrust is carried to and fro, and the water counts as undisturbed."""
    tank = _tank(waves={"amplitude_m": 0.05, "period_s": 2.0}, silt=CLEAN)
    _fly(tank, 1.0, np.zeros(8))
    assert 0.005 < abs(tank.state.X_WB.p_m[0]) < 0.2
    assert tank.measure().target_speed_p95_m_s == 0.0
    assert tank.measure().target_pressure_mean_Pa > 0.0


def test_bad_commands_are_refused():
    """Wrong number of thrusts, values that are not finite, and a step of no time are bad input."""
    tank = _tank()
    for thrusts, dt_s in ((np.zeros(3), 0.02), (np.full(8, np.nan), 0.02), (np.zeros(8), 0.0)):
        with pytest.raises(InputError):
            tank.step(thrusts, dt_s)


def test_a_target_off_the_bed_is_refused():
    """A target placed for another depth does not stand in this tank."""
    with pytest.raises(InputError, match="stands on a bed"):
        _tank(size_m=(6.0, 5.0, 2.0))


def test_what_does_not_fit_is_refused_before_the_start():
    """A failure of a thruster that is not there, and a cable too short for the start."""
    with pytest.raises(InputError, match="thruster 9, the vehicle has 8"):
        _tank(failures=({"thruster": 9},))
    with pytest.raises(InputError, match=r"tether\.length_m"):
        _tank(tether={"diameter_m": 0.005, "length_m": 0.5})


@pytest.mark.parametrize(
    "bad",
    [
        {"silt": {"load_kg_m2": -0.1}},
        {"waves": {"period_s": 0.5}},
        {"silt": {"kind": "mud"}},
        {"silt": {"grain_m": 0.0}},
        {"flow_step_s": 0.0},
        {"sillt": 1.0},
    ],
)
def test_bad_settings_are_refused(bad):
    """Negative silt, a grain of no size, no time step and unknown fields do not validate."""
    with pytest.raises(ValidationError):
        TankSettings(**bad)


@pytest.mark.parametrize("kind", ["fresh-mud", "fluff", "sand"])
def test_a_flight_over_any_bed_keeps_its_grams(kind):
    """Through seconds of downwash and of rest: bed and water hold what they held, and what is lifted is told."""
    tank = _tank(silt={"kind": kind})
    start, bed = tank.silt.total_kg, tank.silt.bed_kg_m2.copy()
    told = []
    for thrusts in (HOLD_DOWN, np.zeros(8)):
        _fly(tank, 2.0, thrusts)
        told.append(tank.measure())
    silt = tank.silt
    assert silt.total_kg == pytest.approx(start, rel=1e-9)
    assert told[0].silt_lifted_g > 0.0
    assert told[1].silt_lifted_g >= told[0].silt_lifted_g
    assert told[1].silt_suspended_g == pytest.approx(1e3 * silt.suspended_kg)
    settled_kg = silt.lifted_kg - silt.suspended_kg
    left_kg = float((bed - silt.bed_kg_m2).sum()) * silt._cell.prod()
    assert left_kg == pytest.approx(silt.lifted_kg - settled_kg, rel=1e-6)
    assert settled_kg > -1e-12


def test_silt_is_known_in_all_the_water():
    """Silt evenly in the water is told by the inner grid and, in the whole tank, by the outer one."""
    tank = _tank(silt={"kind": "caco3-50mg"})
    grid = tank.concentration_grid()
    outer = grid.outer
    assert outer.values.size < 10_000
    assert outer.origin_W_m[:2] == pytest.approx([-3.0, -2.5])
    far = outer.origin_W_m + outer.spacing_m * (np.array(outer.values.shape) - 1)
    assert far == pytest.approx([3.0, 2.5, 1.5])
    assert outer.values[:, :, 1:].mean() == pytest.approx(0.05, rel=0.05)
    assert grid.values.mean() == pytest.approx(0.05, rel=0.05)


def test_a_swell_works_on_the_bed_of_the_tank():
    """Under a swell the bed's stress beside the target is the swell's, and silt is lifted without any thrust."""
    tank = _tank(waves={"amplitude_m": 0.06, "period_s": 4.0}, p=(1.5, 0.0, 0.7))
    highest = 0.0
    for _ in range(10):
        _fly(tank, 0.2, np.zeros(8))
        highest = max(highest, tank.measure().bed_shear_p95_Pa)
    swell = tank._swell
    peak = float(swell.stress_Pa(np.zeros((1, 2)), 0.0)[0])
    assert highest == pytest.approx(peak, rel=0.15)
    assert tank.measure().silt_lifted_g > 0.0


def test_the_tanks_flakes_drift_with_its_current():
    """Flakes before the camera a second later are where the current has brought them, and are the same ones."""
    tank = _tank(current={"velocity_m_s": (0.05, 0.0, 0.0)}, silt=CLEAN)
    eye = Pose(np.array([0.0, 0.0, 0.8]))
    first = tank.flakes(eye)
    _fly(tank, 1.0, np.zeros(8))
    second = tank.flakes(eye)
    where = dict(zip(second.looks[:, 1], second.p_W_m, strict=True))
    both = [k for k, size in enumerate(first.looks[:, 1]) if size in where]
    assert len(both) > 0.7 * len(first.p_W_m)
    moved = np.array([where[first.looks[k, 1]] for k in both]) - first.p_W_m[both]
    assert np.median(moved, axis=0) == pytest.approx([0.05, 0.0, 0.0], abs=1e-3)
