"""Trim advice: ballast by its effect on the mission's holding thrusts."""

import numpy as np
import pytest

from wakewise.control.ballast_advice import ballasted, net_buoyancy_N, trim_advice
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import compile_body, load_vehicle, restoring_wrench
from wakewise.scene.targets import Region
from wakewise.wake import wake_model

VEHICLE = load_vehicle("paper")
CENTRE = np.array([0.0, 0.0, 1.42])


def region() -> Region:
    rng = np.random.default_rng(0)
    points = CENTRE + rng.uniform(-0.08, 0.08, size=(60, 3))
    distance = np.where(np.arange(60) < 30, 0.0, 0.04)
    return Region(points_W_m=points, weights=np.exp(-distance / 0.05), distance_m=distance)


def orbit(pitch_deg: float, count: int = 4) -> tuple[Pose, ...]:
    angles = 2.0 * np.pi * np.arange(count) / count
    out = []
    for angle in angles:
        place = CENTRE + np.array([-0.6 * np.cos(angle), -0.6 * np.sin(angle), -0.5])
        out.append(Pose(place, quat_from_euler(0.0, np.radians(-pitch_deg), angle)))
    return tuple(out)


def advise(poses, vehicle=VEHICLE, **more):
    return trim_advice(vehicle, poses, region(), wake_model("jet"), **more)


def test_ballast_is_what_it_says():
    """Net buoyancy grows by the float, and the righting moment at level changes by weight times shift."""
    heavy = ballasted(VEHICLE, 1.5, 4.0)
    assert net_buoyancy_N(heavy) - net_buoyancy_N(VEHICLE) == pytest.approx(1.5)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    before, after = (restoring_wrench(compile_body(v, 1000.0, 9.80665), level) for v in (VEHICLE, heavy))
    assert after[2] - before[2] == pytest.approx(-1.5)
    assert abs(after[4] - before[4]) == pytest.approx(4.5 * 9.80665 * 0.004, rel=1e-9)


def test_level_poses_of_a_neutral_vehicle_need_no_thrust():
    """With no trim error and no pitch, the vehicle as it is holds itself."""
    found = advise(orbit(0.0), unknown_N=0.0)
    assert found.now.thrust_N == pytest.approx(0.0, abs=1e-9) and found.now.speed_m_s == pytest.approx(0.0, abs=1e-9)
    assert found.best == found.now and found.words == "leave the ballast as it is"


def test_a_pitched_mission_wants_its_centre_of_gravity_forward():
    """Nose down by 31 deg, gravity balances the righting moment at 10 mm tan(31 deg) = 6 mm forward."""
    rows = advise(orbit(31.0), unknown_N=0.0, floats_N=(0.0,), shifts_mm=(-3.0, 3.0, 6.0, 9.0)).rows
    least = min(rows, key=lambda row: row.effort_N2)
    assert least.shift_mm == 6.0 and least.thrust_N < 0.05


def test_a_floating_vehicle_blows_upwards():
    """The more it floats, the less thrust goes down and the slower the water at a target below it."""
    rows = sorted(advise(orbit(0.0), shifts_mm=(0.0,)).rows, key=lambda row: row.float_N)
    down = [row.down_N for row in rows]
    assert np.all(np.diff(down) <= 1e-9) and down[-1] == pytest.approx(0.0, abs=1e-9)


def test_advice_is_of_least_effort_never_heavy_and_never_worse_by_the_wake_model():
    """No ballast that is as gentle and surely floats needs less; the wake model's own choice is at least as gentle."""
    for pitch in (0.0, 20.0, 40.0):
        found = advise(orbit(pitch))
        assert found.best.speed_m_s <= found.now.speed_m_s and found.best.float_N >= 1.0
        others = [row for row in found.rows if row.float_N >= 1.0 and row.speed_m_s <= found.now.speed_m_s]
        assert all(row.effort_N2 >= found.best.effort_N2 for row in others)
        least = min(row.speed_m_s for row in found.rows)
        assert found.gentlest.speed_m_s <= 1.25 * least
        assert found.wake_words.startswith("least by the wake model alone")


def test_a_vehicle_known_to_be_heavy_is_told_to_float():
    """5 N heavy, known to half a newton: floats take most of the thrust away, at no more speed at the target."""
    for pitch in (0.0, 40.0):
        found = advise(orbit(pitch), net_weight_N=5.0, unknown_N=0.5)
        assert found.now.float_N == pytest.approx(net_buoyancy_N(VEHICLE) - 5.0)
        assert "add floats of" in found.words and 0.5 <= found.best.float_N <= 1.0
        assert found.best.speed_m_s <= found.now.speed_m_s and found.best.thrust_N < 0.5 * found.now.thrust_N


def test_a_weight_that_is_known_is_a_vehicle_that_weighs_it():
    """Net weight told beside the vehicle is as good as net weight in its numbers."""
    beside = advise(orbit(20.0), net_weight_N=2.0, unknown_N=0.0, floats_N=(0.0,), shifts_mm=(0.0,))
    inside = advise(orbit(20.0), vehicle=ballasted(VEHICLE, -2.0), unknown_N=0.0, floats_N=(0.0,), shifts_mm=(0.0,))
    assert beside.now.float_N == pytest.approx(inside.now.float_N, abs=1e-6)
    assert beside.now.thrust_N == pytest.approx(inside.now.thrust_N, rel=0.02)


@pytest.mark.parametrize(
    ("poses", "told", "words"),
    [
        ((), {}, "no poses"),
        (orbit(0.0), {"unknown_N": -1.0}, "unknown_N"),
        (orbit(0.0), {"unknown_N": np.nan}, "unknown_N"),
        (orbit(0.0), {"net_weight_N": np.inf}, "net_weight_N"),
    ],
)
def test_bad_input_is_refused(poses, told, words):
    """An empty mission, a negative trim error, a weight that is no number."""
    with pytest.raises(InputError, match=words):
        advise(poses, **told)
