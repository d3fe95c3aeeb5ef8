"""Angles are in radians where the format says so; where it does not, the unit is told by the key or the angles."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers.angles import read_angles, require_radians, unit_of
from wakewise.robot.importers.xml import SourceLocation

HERE = SourceLocation(Path("a.yaml"), 3)


def rows(*angles: list[float]) -> list[tuple[np.ndarray, SourceLocation]]:
    return [(np.array(row, dtype=float), HERE) for row in angles]


@pytest.mark.parametrize("angle", [45.0, -90.0, 30.0, 180.0, 360.0, 22.0, 7.0])
def test_degrees_where_radians_are_meant_are_refused(angle: float) -> None:
    with pytest.raises(InputError, match=r"a.yaml:3: origin rpy holds the angle .* beyond a turn"):
        require_radians(np.array([0.0, 0.0, angle]), HERE, "origin rpy")


@pytest.mark.parametrize("angle", [0.0, 0.785, -3.1416, 6.2832, 5 * np.pi / 2, 3 * np.pi, -7.854])
def test_radians_pass_and_so_do_a_few_eighths_of_a_turn(angle: float) -> None:
    assert require_radians(np.array([0.0, angle, 0.0]), HERE, "rpy")[1] == angle


def test_a_key_says_the_unit() -> None:
    assert [unit_of(key) for key in ("rpy_deg", "thruster_rpy_degrees", "yaw_rad", "rpy", "regrade")] == [
        "degrees",
        "degrees",
        "radians",
        "",
        "",
    ]
    turned, note = read_angles(rows([0, 0, 1], [0, 0, -2]), "rpy_deg", "rpy_deg")
    np.testing.assert_allclose(turned, np.deg2rad([[0, 0, 1], [0, 0, -2]]))
    assert "says degrees" in note
    with pytest.raises(InputError, match="beyond a turn"):
        read_angles(rows([0, 0, 45]), "rpy_rad", "rpy_rad")


def test_whole_degrees_beyond_a_turn_make_all_rows_degrees() -> None:
    """The small ones too: all rows are of one unit, and the note says that it is a guess."""
    turned, note = read_angles(rows([0, 0, 5], [0, -90, 22.5]), "rpy", "rpy")
    np.testing.assert_allclose(turned, np.deg2rad([[0, 0, 5], [0, -90, 22.5]]))
    assert "inferred" in note and "90" in note


@pytest.mark.parametrize("angles", [[0, 0, 7], [0, 0, 47.3], [0, 0, 1000], [0, 0, 1], [1, 0, 0]])
def test_a_unit_that_cannot_be_told_is_refused(angles: list[float]) -> None:
    """Neither whole degrees nor a turn of radians; and whole radians are nobody's angles."""
    with pytest.raises(InputError, match=r"a.yaml:3: rpy holds .*rpy_deg"):
        read_angles(rows(angles, [0, 0, 0]), "rpy", "rpy")
