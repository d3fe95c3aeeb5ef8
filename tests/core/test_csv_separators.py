"""A table whose columns are separated by another sign than a comma is refused by that reason, whoever reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.thrusters.lag_fit import read_step
from wakewise.robot.thrusters.thrust_table import read_thrust_table
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets.fragility import read_marks
from wakewise.simulation.tank.probe import read_table
from wakewise.simulation.water.current_series import read_current_series
from wakewise.ui.cli.points import read_points


def _points(path: Path) -> Any:
    return read_points(path, load_vehicle("paper"), Pose(np.zeros(3)))


def _cameras(path: Path) -> Any:
    pytest.importorskip("cv2")
    from wakewise.vision.reconstruction import read_reference_cameras

    return read_reference_cameras(path)


def _known(path: Path) -> Any:
    pytest.importorskip("cv2")
    from wakewise.vision.reconstruction.photos.known_cameras import read_known_cameras

    return read_known_cameras(path)


def _fixes(path: Path) -> Any:
    pytest.importorskip("cv2")
    from wakewise.vision.reconstruction.scale.position_fixes import read_fixes

    return read_fixes(path)


READERS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "points": (_points, "x_m,y_m,z_m,weight\n1,2,3,1\n"),
    "marks": (read_marks, "x_m,y_m,z_m,radius_m\n1,2,3,1\n"),
    "reference cameras": (_cameras, "name,x_m,y_m,z_m\na,1,2,3\n"),
    "known cameras": (_known, "name,x_m,y_m,z_m,qw,qx,qy,qz\na,1,2,3,1,0,0,0\n"),
    "fixes": (_fixes, "name,depth_m\na,1\n"),
    "step": (read_step, "time_s,command,thrust_N\n0,1,2\n"),
    "thrust table": (read_thrust_table, "pwm_us,supply_V,thrust_N\n1500,16,0\n"),
    "current": (read_current_series, "time_s,u,v\n0,1,2\n1,1,2\n"),
    "probe": (lambda path: read_table(path, "a table"), "time_s,T1\n0,1\n"),
}


@pytest.mark.parametrize("sign", [";", "\t"], ids=["semicolon", "tab"])
@pytest.mark.parametrize("who", READERS)
def test_another_sign_is_named(tmp_path: Path, who: str, sign: str) -> None:
    """In one line, beside what the columns must be."""
    read, text = READERS[who]
    path = tmp_path / "table.csv"
    path.write_text(text.replace(",", sign), encoding="utf-8")
    with pytest.raises(InputError, match=r"separated by (semicolons|tabs), commas are needed") as fault:
        read(path)
    assert "\n" not in str(fault.value)


def test_commas_are_no_other_sign() -> None:
    """Nothing is added where the names are wrong for another reason."""
    assert other_separator(["x_m", "y_m"]) == ""
    assert other_separator(None) == ""
