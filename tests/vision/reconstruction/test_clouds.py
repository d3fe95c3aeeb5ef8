"""Points and stamps survive the disk, and damage is noticed."""

import errno

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import EnvironmentFailure, InputError, StageError
from wakewise.vision.reconstruction import OrientedPointCloud, read_cloud, write_cloud, write_mesh
from wakewise.vision.reconstruction.sfm.colmap import call, no_stderr
from wakewise.vision.reconstruction.stages import fingerprint, need_room, run_stage


def test_cloud_comes_back(tmp_path):
    """Positions and normals to single precision, colours to a 255th."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cloud = OrientedPointCloud(points_m=rng.normal(size=(50, 3)), normals=normals, colours=rng.random((50, 3)))
    write_cloud(tmp_path / "a.ply", cloud)
    back = read_cloud(tmp_path / "a.ply")
    assert np.allclose(back.points_m, cloud.points_m, atol=1e-6)
    assert np.allclose(back.normals, cloud.normals, atol=1e-6)
    assert np.allclose(back.colours, cloud.colours, atol=0.5 / 255 + 1e-9)


def test_mesh_is_a_cloud_too(tmp_path):
    """The corners of a coloured mesh are read as points."""
    corners = np.eye(3)
    write_mesh(tmp_path / "m.ply", corners, np.array([[0, 1, 2]]), np.full((3, 3), 0.2))
    assert np.allclose(read_cloud(tmp_path / "m.ply").points_m, corners)


@pytest.mark.parametrize("data", [b"", b"ply\nnonsense", b"\x00" * 40])
def test_what_is_no_cloud_is_refused(tmp_path, data):
    """A damaged file is an input error in one line, as is a missing one."""
    (tmp_path / "x.ply").write_bytes(data)
    with pytest.raises(InputError, match=r"x\.ply") as caught:
        read_cloud(tmp_path / "x.ply")
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="does not exist"):
        read_cloud(tmp_path / "y.ply")


def test_stage_runs_once_and_again_when_it_must(tmp_path):
    """Same key and product: skipped. Another key, a lost product or a damaged stamp: done again."""
    product, runs = tmp_path / "p.txt", []

    def work():
        runs.append(1)
        product.write_text("x")
        return {"n": len(runs)}

    def go(key):
        return run_stage(tmp_path, "s", key, (product,), work)

    assert not go("a").skipped
    assert go("a").skipped and go("a").figures == {"n": 1}
    assert not go("b").skipped
    product.unlink()
    assert not go("b").skipped
    (tmp_path / "stages" / "s.json").write_text("{")
    assert not go("b").skipped
    assert len(runs) == 4


def test_failed_stage_leaves_no_stamp(tmp_path):
    """A stage that fails is not taken for done, even if an older product lies there."""
    product = tmp_path / "p.txt"
    product.write_text("old")

    def fail():
        raise StageError("no")

    with pytest.raises(StageError):
        run_stage(tmp_path, "s", "a", (product,), fail)
    assert not run_stage(tmp_path, "s", "a", (product,), dict).skipped


def test_a_full_disk_is_told_and_what_was_done_before_is_kept(tmp_path):
    """A write that finds no room ends as one line that names the folder; the stage before keeps its stamp."""
    run_stage(tmp_path, "first", "a", (), dict)

    def fill():
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "x"))

    with pytest.raises(
        EnvironmentFailure, match=r"second: the disk of .* is full; the stages before it are kept"
    ) as caught:
        run_stage(tmp_path, "second", "b", (), fill)
    assert "\n" not in str(caught.value)
    assert run_stage(tmp_path, "first", "a", (), dict).skipped
    assert not (tmp_path / "stages" / "second.json").exists()


def test_a_stage_that_could_not_bear_a_full_disk_is_not_begun(tmp_path):
    """More than there is on any disk is refused with what is left and what is needed; little is let pass."""
    need_room(tmp_path, 1.0, "match")
    with pytest.raises(EnvironmentFailure, match=r"match: the disk of .* is full, .* MB are left"):
        need_room(tmp_path, 1e18, "match")


def test_points_that_are_no_numbers_are_counted(tmp_path):
    """Two of five are NaN or infinite: the line says so, and what to do."""
    points = np.zeros((5, 3))
    points[1, 0], points[3, 2] = np.nan, np.inf
    trimesh.PointCloud(points).export(tmp_path / "some.ply")
    with pytest.raises(InputError, match=r"some\.ply: 2 of 5 points are NaN or infinite; remove them"):
        read_cloud(tmp_path / "some.ply")


def test_fingerprint_tells_inputs_apart():
    """Order of keys does not matter, values do."""
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    assert fingerprint({"a": 1}) != fingerprint({"a": 2})


def test_a_failing_call_is_a_stage_error_in_one_line():
    """What COLMAP says becomes one line with the name of the stage."""

    def fail(cancellation_token):
        raise ValueError("one\ntwo")

    with pytest.raises(StageError, match="mapping: COLMAP stopped: one two"):
        call(fail, "mapping")


def test_quiet_is_over_when_it_is_over(capfd):
    """Standard error is closed inside and open again after."""
    import os

    with no_stderr():
        os.write(2, b"inside")
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


@pytest.mark.parametrize("fault", [RuntimeError("database or disk is full"), StageError("x: No space left on device")])
def test_what_sqlite_says_of_a_full_disk_is_the_disks_fault(tmp_path, fault):
    """A full disk told in a library's own words is no failure of the photographs; other words stay what they are."""

    def fail():
        raise fault

    with pytest.raises(EnvironmentFailure, match=r"the disk of .* is full"):
        run_stage(tmp_path, "s", "a", (), fail)

    def break_down():
        raise StageError("too few points")

    with pytest.raises(StageError, match="too few points"):
        run_stage(tmp_path, "s", "a", (), break_down)
