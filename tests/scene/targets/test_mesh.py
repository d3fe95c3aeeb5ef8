"""Reading a target from a file: what is kept, what is moved, and what is refused in one line."""

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh, load_mesh, read_mesh, write_mesh
from wakewise.scene.targets.mesh import READABLE_SUFFIXES

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))


def box(extents=(0.1, 0.2, 0.3), shift=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.box(extents=extents)
    return mesh.apply_translation(shift)


def one_line_error(path, size_m=None):
    with pytest.raises(InputError) as caught:
        load_mesh(path, size_m)
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize("suffix", READABLE_SUFFIXES)
def test_every_format_gives_the_same_box_centred_on_its_base(tmp_path, suffix):
    """The box stands on z = 0, centred in x and y, closed, outward and of its own size, whatever the format."""
    path = tmp_path / f"box{suffix}"
    box(shift=(5.0, -7.0, 3.0)).export(path)
    mesh = load_mesh(path)
    assert mesh.is_closed
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), [-0.05, -0.1, 0.0], atol=1e-6)
    np.testing.assert_allclose(mesh.extent_m, [0.1, 0.2, 0.3], atol=2e-6)
    assert mesh.volume_m3 == pytest.approx(0.006, rel=1e-4)


def test_the_stated_size_is_the_largest_dimension(tmp_path):
    """A mesh in unknown units takes the stated size and keeps its proportions."""
    box((10.0, 20.0, 40.0)).export(tmp_path / "box.ply")
    np.testing.assert_allclose(load_mesh(tmp_path / "box.ply", 0.16).extent_m, [0.04, 0.08, 0.16], rtol=1e-6)


def test_inside_out_faces_are_turned(tmp_path):
    """A mesh whose faces point inward is turned, so that outside is outside."""
    mesh = box()
    mesh.invert()
    mesh.export(tmp_path / "box.ply")
    assert load_mesh(tmp_path / "box.ply").volume_m3 > 0


def test_a_real_scan_stays_open_and_comes_to_the_origin():
    """The laser-scanned coral, open below and far from its origin, is recentred and scaled, and its top faces up."""
    path = DATA / "coral_mesh" / "mcap.ply"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    mesh = load_mesh(path, 0.15)
    assert not mesh.is_closed
    assert len(mesh.faces) > 10_000
    assert mesh.extent_m.max() == pytest.approx(0.15)
    assert mesh.vertices_m[:, 2].min() == 0.0
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0)[:2], -mesh.vertices_m.max(axis=0)[:2], atol=1e-12)
    assert mesh.area_vectors_m2[:, 2].sum() > 0


def test_a_real_closed_scan_is_closed():
    """The bunny's own unit is refused with advice; with a size it is read whole."""
    path = DATA / "mesh_bunny" / "bunny.ply"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    assert "--target-size" in one_line_error(path)
    assert load_mesh(path, 0.12).is_closed


def test_files_that_are_no_mesh_are_refused(tmp_path):
    """Missing, empty, a folder, an unknown suffix, text under a mesh's name, points without faces: one line each."""
    assert "no such file" in one_line_error(tmp_path / "none.ply")
    (tmp_path / "empty.ply").touch()
    assert "empty" in one_line_error(tmp_path / "empty.ply")
    (tmp_path / "folder.ply").mkdir()
    assert "not a file" in one_line_error(tmp_path / "folder.ply")
    (tmp_path / "coral.png").write_bytes(b"\x89PNG")
    assert ".ply" in one_line_error(tmp_path / "coral.png")
    for suffix in READABLE_SUFFIXES:
        (tmp_path / f"text{suffix}").write_text("this is no mesh\n")
        assert f"text{suffix}" in one_line_error(tmp_path / f"text{suffix}")
    trimesh.PointCloud(np.random.default_rng(0).random((9, 3))).export(tmp_path / "points.ply")
    assert "no faces" in one_line_error(tmp_path / "points.ply")


def test_vertices_that_are_no_places_are_refused(tmp_path):
    """NaN, absurd coordinates, a face beyond the vertices and a mesh without extent are refused in one line."""

    def obj(name, vertices, face="1 2 3"):
        path = tmp_path / name
        path.write_text("".join(f"v {v}\n" for v in vertices) + f"f {face}\n")
        return path

    assert "finite" in one_line_error(obj("nan.obj", ["nan 0 0", "1 0 0", "0 1 0"]))
    assert "1e+09" in one_line_error(obj("far.obj", ["1e300 0 0", "1 0 0", "0 1 0"]))
    assert one_line_error(obj("beyond.obj", ["0 0 0", "1 0 0", "0 1 0"], "1 2 7"))
    assert "zero area" in one_line_error(obj("point.obj", ["1 1 1", "1 1 1", "1 1 1"]))
    assert "zero area" in one_line_error(obj("line.obj", ["0 0 0", "1 0 0", "2 0 0"]))


@pytest.mark.parametrize("size_m", [0.0, -0.1, 150.0, float("nan"), float("inf")])
def test_a_size_no_target_has_is_refused(tmp_path, size_m):
    """A size that is not between 2 cm and 2 m is refused before the file is read."""
    assert "target size" in one_line_error(tmp_path / "none.ply", size_m)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=400), suffix=st.sampled_from(READABLE_SUFFIXES))
def test_random_bytes_never_do_worse_than_an_input_error(tmp_path, data, suffix):
    """Whatever the bytes are, the reader gives a mesh or an InputError, and stays silent."""
    path = tmp_path / f"random{suffix}"
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            assert isinstance(load_mesh(path, 0.15), Mesh)
        except InputError as error:
            assert "\n" not in str(error)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), suffix=st.sampled_from(READABLE_SUFFIXES))
def test_damaged_meshes_never_do_worse_than_an_input_error(tmp_path, capfd, data, suffix):
    """A real file with bytes changed or cut off gives a mesh or an InputError, and nothing is printed."""
    whole = tmp_path / f"whole{suffix}"
    if not whole.exists():
        box().export(whole)
    content = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    content = content[: data.draw(st.integers(1, len(content)))]
    path = tmp_path / f"damaged{suffix}"
    path.write_bytes(bytes(content))
    try:
        assert isinstance(load_mesh(path, 0.15), Mesh)
    except InputError as error:
        assert "\n" not in str(error)
    assert capfd.readouterr() == ("", "")


def test_faces_must_name_vertices():
    """A mesh record refuses a face that names a vertex it has not."""
    with pytest.raises(InputError, match="allowed 0 to 2"):
        Mesh(np.eye(3), np.array([[0, 1, 3]]))


def test_a_written_mesh_is_read_back_just_as_it_was(tmp_path: Path) -> None:
    """Nothing is moved, scaled or merged on the way through a file; places agree to single precision."""
    mesh = Mesh(np.array([[0, 0, 1.5], [0.1, 0, 1.5], [0, 0.1, 1.4], [0, 0, 1.5]]), np.array([[0, 1, 2], [3, 2, 1]]))
    write_mesh(tmp_path / "truth.ply", mesh)
    back = read_mesh(tmp_path / "truth.ply")
    np.testing.assert_array_equal(back.faces, mesh.faces)
    np.testing.assert_allclose(back.vertices_m, mesh.vertices_m, atol=2e-7)
