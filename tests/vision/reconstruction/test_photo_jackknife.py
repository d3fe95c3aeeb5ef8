import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.vision.evaluation import umeyama
from wakewise.vision.evaluation.bed_and_colony import given_bed
from wakewise.vision.evaluation.measurement import MeasuringRule
from wakewise.vision.reconstruction.quality.finished_models import position_scale_pct, read_model
from wakewise.vision.reconstruction.quality.photo_jackknife import (
    jackknife_sigma,
    jackknife_vertices,
    measure_model,
    photo_groups,
)
from wakewise.vision.reconstruction.sfm.colmap import pycolmap


def model_folder(path: Path, noise_px: float, photos: int = 16, **figures: object) -> Path:
    """A model of points within a ball of half a unit, seen by cameras round it, with noise; its mesh is that ball."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig = 1, 1, photos
    options.num_points3D = 400
    pycolmap.set_random_seed(1)
    model = pycolmap.synthesize_dataset(options)
    if noise_px > 0.0:
        noise = pycolmap.SyntheticNoiseOptions()
        noise.point2D_stddev = noise_px
        pycolmap.synthesize_noise(noise, model)
    (path / "sparse").mkdir(parents=True)
    model.write_binary(path / "sparse")
    trimesh.creation.icosphere(4, 0.5).export(path / "mesh.ply")
    (path / "reconstruction.json").write_text(json.dumps({"scale": 1.0, **figures}))
    return path


def spread_of(folder: Path) -> float:
    """Root mean square way of the surface over the groups."""
    model = read_model(folder)
    assert model.sparse is not None
    ways = [
        v - model.mesh.vertices_m for v in jackknife_vertices(model.sparse, model.mesh.vertices_m, 1.0, fixed=False)
    ]
    return float(np.sqrt(np.mean(np.square(ways))))


def test_spread_of_the_surface_goes_with_the_noise_of_the_photographs(tmp_path: Path) -> None:
    """Without noise the surface stays; with twice the noise it moves about twice as far."""
    still, one, two = (spread_of(model_folder(tmp_path / f"{px}", px)) for px in (0.0, 0.5, 1.0))
    assert still < 0.02 * one
    assert 1.5 < two / one < 2.7


def test_intervals_hold_the_scale_by_its_power(tmp_path: Path) -> None:
    """Volume takes the scale's uncertainty three times, rugosity not at all, and each interval holds its figure."""
    bars = {"used": True, "uncertainty_pct": 0.5}
    model = read_model(model_folder(tmp_path / "m", 0.5, scale_bars=bars))
    rule = MeasuringRule(bed=given_bed(np.array([0.0, 0.0, 1.0]), 0.0))
    found = measure_model(model, rule, np.random.default_rng(0))
    assert found.why is None and found.groups == 8
    volume, rugosity = found.intervals["volume_cm3"], found.intervals["rugosity"]
    assert volume.scale_sigma == pytest.approx(0.015 * volume.value) and rugosity.scale_sigma == 0.0
    assert all(one.low is not None and one.low < one.value < (one.high or 0.0) for one in found.intervals.values())


def test_too_few_photographs_give_no_interval(tmp_path: Path) -> None:
    """The figures are there, their intervals are not, and the number is said."""
    model = read_model(model_folder(tmp_path / "m", 0.5, photos=6))
    rule = MeasuringRule(bed=given_bed(np.array([0.0, 0.0, 1.0]), 0.0))
    found = measure_model(model, rule, np.random.default_rng(0))
    assert found.why is not None and "6 photographs" in found.why
    assert found.intervals["height_mm"].value == pytest.approx(500.0, rel=0.01)
    assert found.intervals["height_mm"].low is None


def test_jackknife_sigma_of_group_means_is_that_of_the_mean() -> None:
    """Of ten groups of independent numbers it is the standard error of their mean, within a fifth over 400 draws."""
    draws = np.random.default_rng(0).normal(size=(400, 10))
    without = (draws.sum(axis=1, keepdims=True) - draws) / 9.0
    mean = np.sqrt(np.mean([jackknife_sigma(row) ** 2 for row in without]))
    assert mean == pytest.approx(1.0 / np.sqrt(10.0), rel=0.2)


@given(st.integers(8, 200))
def test_groups_hold_each_photograph_once(count: int) -> None:
    """At most ten groups of neighbours, whose sizes differ by one at most, none with one photograph alone."""
    names = [f"{k:04}" for k in range(count)]
    groups = photo_groups(names)
    assert [name for group in groups for name in group] == names
    sizes = [len(group) for group in groups]
    assert len(groups) <= 10 and max(sizes) - min(sizes) <= 1 and min(sizes) >= 2


def test_scale_of_camera_positions_is_as_unsure_as_drawn_ones_scatter() -> None:
    """Of 300 sets of 20 positions with errors the fitted scales scatter as said, within 15 %."""
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.5, 0.5, (20, 3))
    scales, said = [], []
    for _ in range(300):
        fit = umeyama(places, measured := places + rng.normal(0.0, 0.004, places.shape))
        scales.append(fit.scale)
        rmse = float(np.sqrt(((fit.apply(places) - measured) ** 2).sum(axis=1).mean()))
        said.append(position_scale_pct(rmse, places, 20))
    assert np.mean(said) == pytest.approx(100.0 * np.std(scales), rel=0.15)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_are_refused_and_nothing_else(tmp_path: Path, data: st.DataObject) -> None:
    """Whatever bytes stand in a mesh or in reconstruction.json, reading gives a model or InputError."""
    folder = tmp_path / "damaged"
    folder.mkdir(exist_ok=True)
    whole = trimesh.creation.icosphere(1, 0.5).export(file_type="ply")
    assert isinstance(whole, bytes)
    at = data.draw(st.integers(0, len(whole) - 1))
    (folder / "mesh.ply").write_bytes(whole[:at] + data.draw(st.binary(max_size=8)) + whole[at + 4 :])
    text = data.draw(st.sampled_from(['{"scale": 1.0}', "[]", "{", '{"scale": null}', '{"scale_bars": 3, "scale": 2}']))
    (folder / "reconstruction.json").write_text(text)
    try:
        model = read_model(folder)
    except InputError:
        return
    assert np.isfinite(model.mesh.vertices_m).all()
