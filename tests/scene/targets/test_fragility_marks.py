"""Marks are read as they were written, and anything else is refused in one line."""

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh, load_mesh, read_marks, read_vertex_scores
from wakewise.scene.targets.fragility import FragilityMarks

HEADER = "x_m,y_m,z_m,radius_m,weight\n"
place = st.floats(-1.0, 1.0)
mark = st.tuples(place, place, place, st.floats(1e-4, 1.0), st.floats(0.0, 1.0))


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(mark, min_size=1, max_size=8))
def test_marks_come_back_as_written(tmp_path, marks):
    """Every number to the last bit."""
    path = tmp_path / "marks.csv"
    path.write_text(HEADER + "".join(",".join(map(repr, row)) + "\n" for row in marks))
    read = read_marks(path)
    np.testing.assert_array_equal(np.column_stack([read.centres_m, read.radii_m, read.weights]), np.array(marks))


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.one_of(st.text(max_size=80), st.text(max_size=60).map(lambda text: HEADER + text)))
def test_any_text_is_read_or_refused_in_one_line(tmp_path, text):
    """Never another exception, never a silent NaN."""
    path = tmp_path / "any.csv"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        read = read_marks(path)
    except InputError as error:
        assert "\n" not in str(error) or "\n" in text
    else:
        assert np.all(np.isfinite(read.centres_m))
        assert np.all(read.radii_m > 0)


def test_the_weight_may_be_left_out_and_columns_may_stand_in_any_order(tmp_path):
    """Without a weight a mark counts in full; blank lines are skipped."""
    path = tmp_path / "m.csv"
    path.write_text("radius_m, z_m ,x_m,y_m\n0.01,0.3,0.1,0.2\n\n")
    read = read_marks(path)
    np.testing.assert_array_equal(read.centres_m, [[0.1, 0.2, 0.3]])
    np.testing.assert_array_equal(read.weights, [1.0])


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("nan,0,0,0.01,1", "x_m 'nan'"),
        ("0,inf,0,0.01,1", "y_m 'inf'"),
        ("0,0,0,0,1", "radius_m '0'"),
        ("0,0,0,-0.01,1", "radius_m '-0.01'"),
        ("0,0,0,0.01,1.5", "weight '1.5'"),
        ("0,0,0,0.01,nan", "weight 'nan'"),
        ("0,0,0", "radius_m ''"),
        ("a,0,0,0.01,1", "x_m 'a'"),
    ],
)
def test_a_bad_mark_is_named_with_its_line(tmp_path, row, said):
    """File, line, column, what was found."""
    path = tmp_path / "bad.csv"
    path.write_text(HEADER + "0,0,0,0.01,1\n" + row + "\n")
    with pytest.raises(InputError, match=f"line 3: {said}"):
        read_marks(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no column"),
        ("x_m,y_m\n", "no column z_m"),
        (HEADER, "no marks"),
        ("x_m,y_m,z_m,radius_m,weigth\n1,2,3,1,0.5\n", "unknown column 'weigth'"),
    ],
)
def test_a_file_without_marks_is_refused(tmp_path, text, said):
    """Empty, wrong header, header only."""
    path = tmp_path / "none.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_marks(path)
    with pytest.raises(InputError, match="no such file"):
        read_marks(tmp_path / "absent.csv")


def test_scores_are_those_of_the_ball_a_vertex_lies_in():
    """Of balls that overlap the highest; 0 outside."""
    marks = FragilityMarks(
        centres_m=np.array([[0.0, 0, 0], [0.0, 0, 0]]), radii_m=np.array([2.0, 1.0]), weights=np.array([0.3, 0.8])
    )
    mesh = Mesh(np.array([[0.5, 0, 0], [1.5, 0, 0], [2.5, 0, 0]]), np.array([[0, 1, 2]]))
    np.testing.assert_array_equal(marks.scores(mesh), [0.8, 0.3, 0.0])


def write_ply(path, scores):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=80.0)
    ball.apply_translation([500.0, 100.0, -30.0])
    ball.vertex_attributes["delicate"] = scores(ball.vertices).astype(np.float32)
    ball.export(path)


def test_the_property_of_a_ply_is_found_again_on_the_loaded_mesh(tmp_path):
    """Though loading moves, scales and merges the vertices."""
    path = tmp_path / "ball.ply"
    write_ply(path, lambda v: (v[:, 2] > 0).astype(float))
    mesh = load_mesh(path, 0.16)
    scores = read_vertex_scores(path, mesh)
    np.testing.assert_array_equal(scores, (mesh.vertices_m[:, 2] > 0.08 + 0.03 - 1e-9).astype(float))


def test_a_ply_without_the_property_has_no_scores_and_a_bad_one_is_refused(tmp_path):
    """NaN and numbers beyond 1 are no scores."""
    path = tmp_path / "plain.ply"
    trimesh.creation.icosphere(subdivisions=1, radius=0.05).export(path)
    assert read_vertex_scores(path, load_mesh(path)) is None
    for bad in (np.nan, 1.5, -0.1):
        write_ply(path, lambda v, bad=bad: np.full(len(v), bad))
        with pytest.raises(InputError, match="from 0 to 1"):
            read_vertex_scores(path, load_mesh(path, 0.16))
