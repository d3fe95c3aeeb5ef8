"""Files of plain numbers: what is a matrix, what is a table of factors, what is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.importers.find import MOTOR_COLUMNS, read_number_matrix
from wakewise.robot.vehicles import ARDUSUB_VECTORED_6DOF
from wakewise.robot.vehicles.mixing import factors_as_wrench


@pytest.mark.parametrize("delimiter", [",", " ", "\t", ", "])
def test_six_lines_of_numbers_are_a_matrix(tmp_path: Path, delimiter: str) -> None:
    matrix = np.random.default_rng(1).normal(size=(6, 5))
    path = tmp_path / "m.txt"
    np.savetxt(path, matrix, delimiter=delimiter, header="a comment")
    found, signs = read_number_matrix(path)
    assert np.array_equal(found, matrix)
    assert not signs


def test_a_table_of_factors_holds_signs(tmp_path: Path) -> None:
    rows = [",".join(MOTOR_COLUMNS)]
    rows += [",".join(map(str, [i + 1, *row])) for i, row in enumerate(ARDUSUB_VECTORED_6DOF)]
    path = tmp_path / "mixer.csv"
    path.write_text("\n".join(rows))
    found, signs = read_number_matrix(path)
    assert signs
    assert np.array_equal(found, factors_as_wrench(ARDUSUB_VECTORED_6DOF))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", r"shape \(0,\), allowed \(6, n\)"),
        (b"1 2\n3 4\n", r"shape \(2, 2\), allowed \(6, n\)"),
        (b"1 2\n3\n", "rows of different length"),
        (b"1\n2\n3\n4\n5\nsix\n", "not a number"),
        (b"1\n2\n3\n4\n5\nnan\n", "holds NaN"),
        (b"\xff\xfe\x00", "not UTF-8"),
        (b"motor,roll,pitch,yaw,throttle,forward,lateral\n1,2\n", r"motor factors of shape \(1, 1\)"),
        (b"0" * 1_000_001, "at most 1000000"),
    ],
)
def test_what_is_no_matrix_is_refused_with_the_file(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        read_number_matrix(path)
    assert "bad.csv" in str(caught.value)
    with pytest.raises(InputError, match="no such file"):
        read_number_matrix(tmp_path / "none.csv")


@settings(max_examples=60, deadline=None)
@given(content=st.text(alphabet="0123456789.,-e \nn#amotr", max_size=80))
def test_any_text_is_a_matrix_or_one_line(tmp_path_factory: pytest.TempPathFactory, content: str) -> None:
    path = tmp_path_factory.mktemp("any") / "any.csv"
    path.write_text(content)
    try:
        found, _ = read_number_matrix(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert found.shape[0] == 6
