"""Wall jets: the law of a square strike, momentum along the bed of a slanting one, and where there is none.

square strike     u_max = 1.16 sqrt(M) / r, half thickness 0.09 r, the same all round
slanting strike   momentum along the bed is M cos(psi), all of it M
anywhere          along the bed, radial from the strike point, level with the arriving jet at most, sqrt(T)
"""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake import ImpingingJet, RoundJet, WakeSettings, gram, point_disturbance, wake_model

AREA = np.array([np.pi * 0.03**2])
AREA.flags.writeable = False
RHO = 998.0
BED_M = 1.5
MODEL = ImpingingJet(jet=RoundJet(), bed_z_m=BED_M)


def wall(points, height=0.6, slant=0.0):
    """Wall jet alone, per root of newton, of a jet from `height` above that strikes at the origin, slanting to +x."""
    direction = np.array([[np.sin(slant), 0.0, np.cos(slant)]])
    origin = np.array([[-height * np.tan(slant), 0.0, BED_M - height]])
    points = np.atleast_2d(points).astype(float)
    both = MODEL.unit_velocity(points, origin, direction, AREA)[0]
    return both - RoundJet().unit_velocity(points, origin, direction, AREA)[0]


def on_bed(r, angle=0.0, height=0.0):
    r, angle, height = np.broadcast_arrays(r, angle, height)
    return np.stack([r * np.cos(angle), r * np.sin(angle), BED_M - height], axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("r", [0.4, 0.8, 1.5])
def test_a_square_strike_spreads_by_the_published_law(r):
    """u_max r / sqrt(M) = 1.16 within 2 % beyond twice the turning zone, all round, outwards; half at 0.09 r, 2 %."""
    angles = np.linspace(0, 2 * np.pi, 13)
    u = wall(on_bed(r, angles))
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    np.testing.assert_allclose(u[:, :2], outward * 1.16 / np.sqrt(RHO) / r, rtol=0, atol=0.02 * 1.16 / np.sqrt(RHO) / r)
    np.testing.assert_array_equal(u[:, 2], 0.0)
    half = np.linalg.norm(wall(on_bed(r, 0.0, 0.09 * r))) / np.linalg.norm(wall(on_bed(r)))
    assert half == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("height", [0.1, 0.3, 0.6, 1.2])
def test_the_wall_jet_is_never_faster_than_the_jet_that_feeds_it(height):
    """Its greatest speed on the bed is that with which the free jet arrives, and at the strike point it is zero."""
    speed = np.linalg.norm(wall(on_bed(np.linspace(0.0, 1.0, 4001)), height), axis=1)
    arriving = float(RoundJet().speed(height, 0.0, 1.0, AREA)[0])
    assert speed.max() == pytest.approx(arriving, rel=1e-3)
    assert speed[0] == 0.0


@pytest.mark.parametrize("slant_deg", [0, 20, 45, 65])
def test_a_slanting_strike_keeps_momentum_along_the_bed(slant_deg):
    """Of the momentum flux M through a far circle, the part along x is M cos(psi), psi the angle to the bed.

    Flux per angle goes with u^2; the level of a square strike is M, so shares are means over the circle.
    """
    angles = np.linspace(0, 2 * np.pi, 20001)[:-1]
    r = 30.0
    u2 = np.sum(wall(on_bed(r, angles), 0.5, np.deg2rad(slant_deg)) ** 2, axis=1)
    square = np.sum(wall(on_bed(r), 0.5) ** 2)
    assert np.mean(u2) / square == pytest.approx(1.0, rel=2e-3)
    assert np.mean(u2 * np.cos(angles)) / square == pytest.approx(np.sin(np.deg2rad(slant_deg)), abs=2e-3)


def test_level_and_rising_jets_never_land():
    """A jet within 3 deg of level, one that rises, and one that starts below the bed make no wall jet."""
    points = on_bed(np.linspace(0.1, 1, 5))
    for direction, z in (
        ((1.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, -1.0), 1.0),
        ((0.999, 0.0, 0.0447), 1.0),
        ((0, 0, 1), 1.6),
    ):
        arguments = (points, np.array([[0.0, 0.0, z]]), np.array([direction], dtype=float), AREA)
        np.testing.assert_array_equal(
            MODEL.unit_velocity(*arguments), RoundJet().unit_velocity(*arguments), err_msg=f"{direction}"
        )


def test_bed_beside_the_target_feels_a_jet_that_misses_it():
    """Points on the bed 0.3 m beside the strike point are disturbed; without the floor they are not."""
    points, weights = on_bed(0.3, np.linspace(0, 6, 20)), np.ones(20)
    points.flags.writeable = weights.flags.writeable = False
    place = (points, weights, np.array([[0.0, 0.0, 0.9]]), np.array([[0.0, 0.0, -1.0]]), AREA)
    assert gram(RoundJet(), *place)[0, 0] < 1e-12
    u = 1.16 / np.sqrt(RHO) / 0.3
    assert gram(MODEL, *place)[0, 0] / 20 == pytest.approx(u**2, rel=0.1)
    assert gram(MODEL, *place)[1, 1] == 0.0


@pytest.mark.parametrize("name", ["paper", "fitted", "jet", "jet-fitted"])
@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
def test_the_quadratic_form_with_a_floor_is_the_definition(name, superposition):
    """The form s' G s equals the sum over points to one part in 10^12, wall jets of many directions included."""
    rng = np.random.default_rng(4)
    model = wake_model(WakeSettings(model=name, floor=True), BED_M)
    points = np.array([0, 0, 1.4]) + 0.15 * rng.uniform(-1, 0.6, (400, 3))
    origins = np.array([0, 0, 0.8]) + 0.2 * rng.uniform(-1, 1, (8, 3))
    axes = np.array([0, 0, 1.0]) + 0.6 * rng.normal(size=(8, 3))
    axes *= rng.choice([-1, 1], (8, 1)) / np.linalg.norm(axes, axis=1)[:, None]
    place = (points, rng.random(400), origins, axes, np.full(8, AREA[0]))
    thrusts = rng.uniform(-10, 10, 8)
    s = np.sqrt(np.concatenate([np.maximum(thrusts, 0), np.maximum(-thrusts, 0)]))
    G = gram(model, *place, superposition)
    assert s @ G @ s == pytest.approx(point_disturbance(model, *place, thrusts, superposition), rel=1e-12)
    assert np.linalg.eigvalsh(G).min() >= -1e-12 * np.trace(G)


def test_a_bed_nowhere_is_refused():
    """NaN for a depth is named."""
    with pytest.raises(InputError, match="bed_z_m nan, must be finite"):
        ImpingingJet(jet=RoundJet(), bed_z_m=np.nan)
