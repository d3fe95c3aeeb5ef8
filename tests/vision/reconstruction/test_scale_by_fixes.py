"""A model's scale and its down from fixes: as sure as they are, and not used where they tell too little."""

import json

import numpy as np
import pytest
import tagged_relief as scene
from scipy.spatial.transform import Rotation

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.vision.reconstruction.scale.position_fixes import (
    MOST_UNSURE_PCT,
    PositionFix,
    PositionFixes,
    place_by_fixes,
    why_unused,
)
from wakewise.vision.reconstruction.scale.stage import place_model
from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

SCALE = 0.137
TURN = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix()


def cameras(rng, count=40, spread_m=(4.0, 3.0, 1.5)):
    """Places in m, north east down, by photo."""
    return {f"{k:02d}.jpg": rng.normal(size=3) * spread_m + [10.0, -5.0, 8.0] for k in range(count)}


def in_model(places):
    """The same in a model of another size, turn and origin."""
    return {name: TURN.T @ (place - [1.0, 2.0, 3.0]) / SCALE for name, place in places.items()}


def told(rng, places, sigma_m, depth_sigma_m, flat=True):
    """Fixes with errors of just these sizes."""
    sigmas = np.array([sigma_m, sigma_m, depth_sigma_m])
    fixes = {}
    for name, place in places.items():
        seen = place + rng.normal(size=3) * sigmas
        fixes[name] = PositionFix(place_W_m=seen if flat else np.array([np.nan, np.nan, seen[2]]), sigma_m=sigmas)
    return PositionFixes(fixes=fixes)


@pytest.mark.parametrize("flat", [True, False])
def test_without_errors_the_similarity_is_found(flat):
    """Scale, down, and with north and east the whole frame."""
    rng = np.random.default_rng(1)
    places = cameras(rng)
    placed = place_by_fixes(in_model(places), told(rng, places, 1e-9, 1e-9, flat))
    assert placed.scale == pytest.approx(SCALE, rel=1e-5)
    assert placed.turned == flat
    assert placed.far == ()
    for name, centre in in_model(places).items():
        found = placed.scale * placed.R @ centre + placed.t
        assert found[2] == pytest.approx(places[name][2], abs=1e-4)
        if flat:
            assert found == pytest.approx(places[name], abs=1e-4)
    assert np.linalg.det(placed.R) == pytest.approx(1.0)


@pytest.mark.parametrize("flat", [True, False])
def test_the_uncertainty_is_what_it_says(flat):
    """Over 200 draws the scale's errors are as large as stated, within what so many draws tell."""
    z = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        places = cameras(rng)
        placed = place_by_fixes(in_model(places), told(rng, places, 3.0 if flat else 1.0, 0.3, flat))
        z.append(np.log(placed.scale / SCALE) / (placed.uncertainty_pct / 100.0))
    assert np.std(z) == pytest.approx(1.0, abs=0.2)
    assert abs(np.mean(z)) < 0.3


@pytest.mark.parametrize("flat", [True, False])
def test_wrong_fixes_are_told_and_hardly_pull(flat):
    """Three of forty photos with a depth 20 m off: named, and the scale stays within 3 %."""
    rng = np.random.default_rng(5)
    places = cameras(rng)
    fixes = dict(told(rng, places, 0.3, 0.05, flat).fixes)
    for name in ("03.jpg", "17.jpg", "30.jpg"):
        fixes[name] = PositionFix(
            place_W_m=fixes[name].place_W_m + np.array([0.0, 0.0, 20.0]), sigma_m=fixes[name].sigma_m
        )
    placed = place_by_fixes(in_model(places), PositionFixes(fixes=fixes))
    assert {"03.jpg", "17.jpg", "30.jpg"} <= set(placed.far)
    assert placed.scale == pytest.approx(SCALE, rel=0.03)


def test_fixes_that_tell_no_scale_are_not_used():
    """Depths of a level flight, GPS of a model a metre across, cameras on one line with depths alone: all unsure."""
    rng = np.random.default_rng(2)
    level = cameras(rng, spread_m=(4.0, 3.0, 0.0))
    small = cameras(rng, spread_m=(0.5, 0.5, 0.2))
    line = {f"{k:02d}.jpg": np.array([0.3 * k, 0.1 * k, 0.0]) for k in range(30)}
    for placed in (
        place_by_fixes(in_model(level), told(rng, level, 3.0, 0.1, flat=False)),
        place_by_fixes(in_model(small), told(rng, small, 3.3, 6.6)),
        place_by_fixes(in_model(line), told(rng, line, 3.0, 0.1, flat=False)),
        place_by_fixes(in_model(line), told(rng, line, 1e-3, 1e-3)),
    ):
        assert placed.uncertainty_pct > MOST_UNSURE_PCT
        assert why_unused(placed).startswith("uncertain by ")
        assert why_unused(placed).endswith("photos must be farther apart" if placed.turned else "not along one line")


def test_photos_without_names_of_fixes_are_said():
    """Names that are not the photos' own."""
    rng = np.random.default_rng(3)
    places = cameras(rng)
    with pytest.raises(InputError, match="0 of 40 registered photos have one"):
        place_by_fixes(
            in_model(places), PositionFixes(fixes={"x.jpg": PositionFix(place_W_m=np.zeros(3), sigma_m=np.ones(3))})
        )


def test_a_model_on_disk_comes_to_lie_where_its_fixes_are(tmp_path):
    """Metres and down after the stage, the same when it runs again; only checked where it is to be kept."""
    rng = np.random.default_rng(4)
    places = cameras(rng, 12)
    turned = Pose.from_matrix(TURN, np.zeros(3))
    truth = {name: Pose(TURN.T @ place, turned.q) for name, place in places.items()}
    scene.true_model(tmp_path / "sparse", truth, 0.5)
    fixes = told(rng, places, 0.02, 0.02)
    kept = place_model(tmp_path / "sparse", fixes, keep=True)["scale_fixes"]
    assert not kept["used"]
    assert kept["model_off_pct"] == pytest.approx(100.0, abs=2.0)
    for _ in range(2):
        said = place_model(tmp_path / "sparse", fixes)["scale_fixes"]
        centres = camera_centres(tmp_path / "sparse")
        for name, place in places.items():
            assert centres[name] == pytest.approx(place, abs=0.05)
        assert said["used"]
        assert said["why"] is None
        assert said["horizontal_rms_m"] < 0.03
        assert json.dumps(said)
