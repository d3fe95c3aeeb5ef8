"""The calibration in place, on flakes whose water is known: it finds the width, and better with more of them."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import FlakeCloud
from wakewise.robot.vehicles import load_vehicle
from wakewise.vision.imaging import PinholeCamera
from wakewise.wake import RoundJet
from wakewise_paper.flight_fit import flake_likelihood
from wakewise_paper.flight_fit.flake_likelihood import _jets, _tabulated, cost, fit_flight
from wakewise_paper.flight_fit.flake_tracks import (
    APART_S,
    BLUR_NOISE,
    LEAST_COVER,
    PIXEL_NOISE,
    FlakeObserver,
    FlakeTracks,
    blur_radius_px,
    cover,
)

CAMERA = PinholeCamera(960, 720, float(np.radians(90.0)))
VEHICLE = load_vehicle("paper")
CURRENT = np.array([0.03, -0.02, 0.0])


def seen(slope, pairs, seed=0, gain=1.0, per_pair=20):
    """Flakes in bent and gusty jets of that slope and a current, seen from a vehicle that hovers and pushes."""
    rng = np.random.default_rng(seed)
    X_WB = Pose(np.array([0.0, 0.0, 1.0]))
    X_WC = X_WB @ VEHICLE.X_BC_at(0.0)
    m = len(VEHICLE.thrusters)
    model = RoundJet(half_width_slope=slope)
    parts, pushes = [], []
    for _ in range(pairs):
        thrusts = rng.uniform(-0.8, 0.8, m)
        push = np.concatenate([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)])
        depth = 0.6 * rng.random(40 * per_pair) ** (1 / 3)
        size = rng.standard_normal(40 * per_pair)
        shown = np.flatnonzero((depth > 0.04) & (cover(CAMERA, np.maximum(depth, 0.04), size) > LEAST_COVER))[:per_pair]
        depth, size = depth[shown], size[shown]
        pixels = rng.uniform((0.0, 0.0), (960.0, 720.0), (len(depth), 2))
        at = X_WC.apply(CAMERA.unproject(pixels, depth))
        there = SimpleNamespace(X_WB=(X_WB,), pushes_N=push[None])
        blown, axis = np.split(_jets([model], there, 0, VEHICLE, at, CURRENT)[0], [3], axis=1)
        rough = 0.25 * np.sqrt(np.linalg.norm(blown, axis=1, keepdims=True) * axis)
        velocity = gain * (blown + rough * rng.standard_normal(at.shape)) + CURRENT
        after = CAMERA.project(X_WC.inverse().apply(at + APART_S * velocity))
        moved = after - pixels + rng.normal(0.0, np.sqrt(2.0) * PIXEL_NOISE, pixels.shape)
        kept = np.linalg.norm(moved, axis=1) < 40.0
        radius = blur_radius_px(CAMERA, depth, size) + rng.normal(0.0, BLUR_NOISE, len(depth))
        parts.append((pixels[kept], moved[kept], radius[kept]))
        pushes.append(push)
    counts = [len(part[2]) for part in parts]
    return FlakeTracks(
        pair=np.repeat(np.arange(pairs), counts),
        first_px=np.concatenate([part[0] for part in parts]),
        moved_px=np.concatenate([part[1] for part in parts]),
        blur_px=np.concatenate([part[2] for part in parts]),
        times_s=np.arange(float(pairs)),
        X_WC=(X_WC,) * pairs,
        X_WC_next=(X_WC,) * pairs,
        X_WB=(X_WB,) * pairs,
        pushes_N=np.array(pushes),
    )


@cache
def fitted(slope, pairs, seed, gain=1.0):
    return fit_flight(seen(slope, pairs, seed, gain), CAMERA, VEHICLE)


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.1, 0.16])
def test_it_finds_the_width_that_the_water_has(slope):
    """Within 12 %, and the current within 3 mm/s, from a minute of pairs with a pixel's noise and unknown depths."""
    fit = fitted(slope, 60, 1)
    assert fit.half_width_slope == pytest.approx(slope, rel=0.12)
    assert fit.gain == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(fit.current_m_s, CURRENT, atol=0.003)
    assert fit.told


def test_the_strength_is_found_apart_from_the_width():
    """Thrusters a quarter weaker than believed are told from wider jets."""
    fit = fitted(0.12, 60, 2, gain=0.75)
    assert fit.gain == pytest.approx(0.75, abs=0.08)
    assert fit.half_width_slope == pytest.approx(0.12, rel=0.15)


@pytest.mark.slow
def test_the_error_falls_with_minutes():
    """As the root of the number of flakes, by the fit's own word and in truth over some draws."""
    few, many = ([fitted(0.13, pairs, seed) for seed in (3, 4, 5)] for pairs in (8, 60))
    assert np.mean([f.slope_error for f in many]) < 0.5 * np.mean([f.slope_error for f in few])
    worst = [max(abs(f.half_width_slope - 0.13) for f in fits) for fits in (few, many)]
    assert worst[1] < worst[0]


def test_still_water_tells_nothing_of_the_width():
    """Without pushes only the prior speaks, and the fit says so."""
    still = seen(0.13, 30, 6)
    quiet = FlakeTracks(**{name: getattr(still, name) for name in (
        "pair", "first_px", "blur_px", "times_s", "X_WC", "X_WC_next", "X_WB")},
        moved_px=0.0 * still.moved_px, pushes_N=0.0 * still.pushes_N)  # fmt: skip
    fit = fit_flight(quiet, CAMERA, VEHICLE)
    assert not fit.told
    assert fit.half_width_slope == pytest.approx(
        np.sqrt(flake_likelihood.NARROWEST * flake_likelihood.WIDEST), rel=0.02
    )


def test_the_gradient_is_that_of_the_cost():
    """Against central differences, between the slopes at which the jets are computed."""
    table = _tabulated(seen(0.13, 6, 7), CAMERA, VEHICLE, CURRENT)
    at = np.array([np.log(0.13), 0.1, 0.02, -0.01, 0.001])
    for i, slope in enumerate(cost(table, at)[1]):
        step = 1e-6 * np.eye(5)[i]
        difference = (cost(table, at + step)[0] - cost(table, at - step)[0]) / 2e-6
        assert slope == pytest.approx(difference, rel=1e-4, abs=1e-3)


def test_weights_of_depth_are_a_distribution_that_blur_sharpens():
    """They add up to 1, and a wide disk says near."""
    weight = np.exp(flake_likelihood._log_weights(CAMERA, np.array([0.8, 3.5])))
    np.testing.assert_allclose(weight.sum(axis=1), 1.0)
    depth = weight @ flake_likelihood.DEPTHS_M
    assert depth[1] < 0.2 < depth[0]


def test_too_few_flakes_are_refused():
    """In one line."""
    with pytest.raises(InputError, match="needs 50 or more"):
        fit_flight(seen(0.1, 1, per_pair=5), CAMERA, VEHICLE)


def test_minutes_cut_the_pairs():
    """The first so many seconds of a flight, whole pairs only."""
    whole = seen(0.1, 10)
    half = whole.until(5.0)
    assert len(half.times_s) == 5
    assert half.pair.max() == 4
    assert len(half) == (whole.pair < 5).sum()


def test_a_flake_is_found_again_where_the_water_took_it():
    """The watcher's pixels are those of the camera's own projection, within its noise, and strangers are not paired."""
    rng = np.random.default_rng(0)
    X_WC = Pose(np.array([0.0, 0.0, 1.0])) @ VEHICLE.X_BC_at(0.0)
    n = 400
    p_C = np.column_stack([rng.uniform(-0.2, 0.2, (n, 2)), rng.uniform(0.2, 0.5, n)])
    looks = np.column_stack([rng.random(n), np.ones(n), rng.random(n)])
    velocity = np.tile([0.0, 0.1, 0.0], (n, 1))
    watcher = FlakeObserver(camera=CAMERA, vehicle=VEHICLE, rng=rng, per_m3=1500.0)
    clouds = [
        FlakeCloud(p_W_m=X_WC.apply(p_C) + t * velocity, v_W_m_s=velocity, looks=looks, low_W_m=np.full(3, -9.0),
                   high_W_m=np.full(3, 9.0), per_m3=1500.0, depth_m=0.62, slopes=(1.0, 0.8))
        for t in (0.0, APART_S)
    ]  # fmt: skip
    push = np.zeros(2 * len(VEHICLE.thrusters))
    frames = [
        (t, X_WC, X_WC, push, watcher._found(cloud, X_WC)) for t, cloud in zip((0.0, APART_S), clouds, strict=True)
    ]
    first, moved, blur = watcher._again(*frames)
    assert len(first) == len(blur) == 30
    # 0.1 m/s for a twenty-fifth of a second at 0.2 to 0.5 m: 480 px per unit slope, 3.8 to 9.6 px across the picture.
    assert (np.abs(moved[:, 0]) > 2.0).all()
    assert (np.abs(moved[:, 0]) < 12.0).all()
    assert np.abs(moved[:, 1]).max() < 6 * PIXEL_NOISE
