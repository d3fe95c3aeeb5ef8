"""What is no path, truth value, function or known number is refused in one line by public functions."""

from pathlib import Path

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.arrays import frozen
from wakewise.core.checks import boolean, callable_of, path_of
from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, text_of
from wakewise.wake import point_files

NO_PATHS = ["a\0b", "\ud800.ply", "n" * 5000, "no/" + "n" * 300 + ".ply"]
NO_KINDS = [5, b"a.ply", None, np.zeros(3)]
SETTINGS = {"water_every_s": np.array([0.1, 0.2]), "checked": "no", "progress": 5, "watch": 5, "exposed": 5}


def refused(call, *given, **named):
    """The one line that a call is refused with."""
    with pytest.raises(InputError) as caught:
        call(*given, **named)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize("value", [*NO_PATHS, *NO_KINDS], ids=lambda value: repr(value)[:12])
def test_a_path_is_text_that_the_operating_system_takes(value):
    """Anything else is refused with its name, and with no more of it than fits a line."""
    told = refused(path_of, value, "photos")
    assert told.startswith("photos: ")
    assert "must be a path" in told
    assert len(told) < 200


@pytest.mark.parametrize("value", ["there is nothing", Path("nor/here"), "/nor/to/be/seen", "é" * 100])
def test_a_path_need_not_be_there(value):
    """Whoever opens it tells of that."""
    assert path_of(value, "photos") == Path(value)


@pytest.mark.parametrize("value", [*NO_PATHS, 5, None], ids=lambda value: repr(value)[:12])
@pytest.mark.parametrize("name", ["photos", "out", "camera", "reference_cameras"])
def test_reconstruct_refuses_what_is_no_path(tmp_path, name, value):
    """Before anything is made."""
    if value is None and name in ("camera", "reference_cameras"):
        pytest.skip("may be left out")
    given = {"photos": tmp_path, "out": tmp_path / "out"} | {name: value}
    assert refused(ww.reconstruct, **given).startswith(f"{name}: ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "wrong",
    [{"region": 5}, {"region": "ab"}, {"region": ([0, 0, 0], "r")}, {"focal_px": "long"}, {"settings": {"levels": 3}}],
    ids=lambda wrong: next(iter(wrong)),
)
def test_reconstruct_refuses_other_things_of_a_wrong_kind(tmp_path, wrong):
    """A region is a centre and a radius."""
    assert refused(ww.reconstruct, tmp_path, tmp_path / "out", **wrong).startswith(next(iter(wrong)))


@pytest.mark.parametrize("value", NO_PATHS, ids=lambda value: repr(value)[:12])
def test_every_other_function_refuses_a_name_that_no_file_can_have(value):
    """Clouds, meshes, scenarios, targets, vehicles, and the folder of a trial before its flight."""
    coral, points = ww.load_target("plate").mesh, np.zeros((5, 3))
    refused(ww.evaluate, value, coral)
    refused(ww.evaluate, points, value)
    refused(ww.Scenario.load, value)
    assert refused(ww.Scenario.load, 5) == "scenario: 5, must be a path"
    refused(ww.load_target, value)
    refused(ww.load_vehicle, value)
    assert refused(ww.trial, ww.Scenario.preset("quick"), value).startswith("folder: ")


@pytest.mark.parametrize("value", NO_KINDS, ids=lambda value: repr(value)[:12])
def test_targets_vehicles_and_trials_refuse_what_is_no_name(value):
    """Neither numbers nor bytes nor arrays are one."""
    refused(ww.load_target, value)
    refused(ww.load_vehicle, value)
    refused(ww.trial, ww.Scenario.preset("quick"), value)


def test_a_path_object_is_as_good_as_text(tmp_path):
    """For targets and vehicles, which have names, too."""
    assert "no such file" in refused(ww.load_target, tmp_path / "a.ply")
    assert "no such file" in refused(ww.load_vehicle, tmp_path / "a.yaml")
    assert "no such file" in refused(ww.load_target, "~nobody-of-that-name/a.ply")


def test_the_size_of_a_target_is_a_number(tmp_path):
    """Words are none."""
    assert refused(ww.load_target, tmp_path / "a.ply", size_m="large").startswith("size_m: ")
    assert refused(ww.load_target, "plate", seed=np.arange(2)).startswith("seed: ")


@pytest.mark.parametrize("value", ["no", 0, 1.0, None, np.array([True, False]), np.array([True])])
def test_a_truth_value_is_true_or_false(value):
    """Nothing is taken by its truth."""
    assert refused(boolean, value, "icp").startswith("icp: ")
    if value is not None:
        assert refused(ww.evaluate, np.zeros((5, 3)), ww.load_target("plate").mesh, icp=value).startswith("icp: ")


def test_both_truth_values_are_taken():
    """NumPy's too."""
    assert boolean(np.bool_(True), "icp") is True
    assert boolean(False, "icp") is False


@pytest.mark.parametrize("name", SETTINGS)
def test_fly_refuses_settings_of_a_wrong_kind(name):
    """Before the flight."""
    assert refused(ww.fly, ww.Scenario.preset("quick"), **{name: SETTINGS[name]}).startswith(f"{name}: ")


def test_what_cannot_be_called_is_no_function():
    """What can be is handed back."""
    assert refused(callable_of, "print", "watch").startswith("watch: ")
    assert callable_of(print, "watch") is print


@pytest.mark.parametrize(
    "value",
    [
        np.ma.masked_all((2, 3)),
        np.ma.array(np.zeros((2, 3)), mask=[[0, 0, 0], [0, 1, 0]]),
        [np.ma.masked_all(3), np.zeros(3)],
    ],
    ids=["all", "one", "list"],
)
def test_an_array_with_masked_elements_is_refused(value):
    """What lies below a mask is not known."""
    assert "masked" in refused(frozen, value, (None, 3), "points")
    rov = ww.load_vehicle("bluerov2-heavy")
    assert "masked" in refused(ww.allocate, rov, np.zeros(6), np.zeros(6), value)


def test_a_masked_array_without_masked_elements_is_taken():
    """It is an array like any other."""
    assert np.array_equal(frozen(np.ma.array([1.0, 2.0]), (2,), "points"), [1.0, 2.0])


@pytest.mark.parametrize("size", [1e10, 1e160, 1e308])
def test_forces_that_overflow_are_refused(size):
    """Wrenches, thrusts and those before."""
    rov = ww.load_vehicle("bluerov2-heavy")
    pose, points = np.zeros(6), [[0.8, 0.0, 0.0]]
    assert refused(ww.allocate, rov, [0, -size, 0, 0, 0, 0]).startswith("wrench_B: ")
    assert refused(ww.allocate, rov, np.ones(6), pose, points, previous_N=np.full(8, size)).startswith("previous_N: ")
    assert refused(ww.disturbance, rov, np.full(8, size), pose, points).startswith("thrusts_N: ")
    assert np.isfinite(ww.allocate(rov, [0, -1e9, 0, 0, 0, 0], pose, points).thrusts_N).all()


def test_a_file_is_read_up_to_its_bound(tmp_path, monkeypatch):
    """One byte more is refused, in one line."""
    path = tmp_path / "points.csv"
    path.write_text("x_m,r_m\n1,2\n", encoding="utf-8")
    assert text_of(path, 12) == "x_m,r_m\n1,2\n"
    with pytest.raises(YamlError, match="larger"):
        text_of(path, 11)
    monkeypatch.setattr(point_files, "MOST_BYTES", 11)
    assert "larger" in refused(point_files.read_point_table, path)


@pytest.mark.parametrize("shape", [(1, 5000, 3), (5000, 1, 3), (2, 9000, 3), (1, 1, 3)])
def test_a_look_refuses_pictures_that_are_lines(tmp_path, shape):
    """By name and size, as a file that is no picture is."""
    cv2 = pytest.importorskip("cv2")
    pytest.importorskip("pycolmap")
    from wakewise.vision.reconstruction.quality.photo_preview import preview_photos

    for name, size in (("a.png", shape), ("b.png", (60, 80, 3)), ("c.png", (60, 80, 3))):
        cv2.imwrite(str(tmp_path / name), np.random.default_rng(0).integers(0, 255, size, dtype=np.uint8))
    assert f"a.png: {shape[1]} x {shape[0]} pixels" in refused(preview_photos, tmp_path)


@pytest.mark.parametrize("shape", [(60, 5000, 3), (5000, 32, 3), (4, 4, 3)])
def test_a_look_at_narrow_pictures_is_finite(tmp_path, shape):
    """Those that are no lines are looked at."""
    cv2 = pytest.importorskip("cv2")
    pytest.importorskip("pycolmap")
    from wakewise.vision.reconstruction.quality.photo_preview import preview_photos

    for name, size in (("a.png", shape), ("b.png", (60, 80, 3)), ("c.png", (60, 80, 3))):
        cv2.imwrite(str(tmp_path / name), np.random.default_rng(0).integers(0, 255, size, dtype=np.uint8))
    look, thumbs = preview_photos(tmp_path)
    assert np.isfinite([photo.sharpness_pct for photo in look.photos]).all()
    assert set(thumbs) == {"a.png", "b.png", "c.png"}
