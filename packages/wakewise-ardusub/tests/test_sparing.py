"""Pulses are judged alike with NumPy alone and with the whole package."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from bare import bare
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.vehicle_summary import VehicleSummary, read_vehicle_summary, vehicle_summary_json
from wakewise_ardusub.wash_savings import SHARES, WashSavingsCalculator, bow_ball, influence_model, saved_pct

POSES = ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.3, -0.2, 0.1, 0.2, -0.15, 0.5))
JUDGE = """
import json, sys
import numpy as np
from pathlib import Path
from wakewise.core.jit.njit import COMPILED
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise_ardusub.vehicle_summary import read_vehicle_summary
from wakewise_ardusub.wash_savings import SHARES, WashSavingsCalculator, bow_ball, influence_model
assert not COMPILED
asked = json.loads(Path(sys.argv[1]).read_text())
craft = read_vehicle_summary(Path(sys.argv[2]))
points = bow_ball(craft.bow_m, craft.camera_z_m, 0.4)
sparing = WashSavingsCalculator(craft, np.array(asked["directions"]))
told = []
for pose in asked["poses"]:
    X_WB = Pose(np.array(pose[:3]), quat_from_euler(*pose[3:]))
    gram = influence_model(craft, points, np.ones(len(points))).gram(X_WB)
    for pulses, volts in asked["rows"]:
        spared = sparing.judge(np.array(pulses), sparing.supply_V(volts), gram)
        told.append([[spared.disturbance[s], spared.thrusts_N[s].tolist()] for s in SHARES])
print(json.dumps(told))
"""


@pytest.mark.parametrize(
    ("vehicle", "model"), [("bluerov2-heavy", "jet"), ("bluerov2", "fitted"), ("bluerov2-heavy-gazebo", "paper")]
)
def test_numpy_alone_judges_as_the_whole_package_does(vehicle: str, model: str, tmp_path: Path) -> None:
    """A fresh process without Numba, SciPy and the solvers: D to 1e-9 of itself, thrusts to a micronewton.

    Pulses from rest to full, so that limits bind, at several voltages; before points as seen and from a tilted pose.
    """
    craft = VehicleSummary.of(load_vehicle(vehicle), wake_model(model))
    rng = np.random.default_rng(3)
    directions = rng.choice([-1.0, 1.0], craft.count)
    rows = [
        ((1500.0 + rng.uniform(-reach, reach, craft.count)).round().tolist(), volts)
        for reach in (40.0, 150.0, 400.0)
        for volts in (13.2, 16.0, None)
        for _ in range(3)
    ]
    (tmp_path / "asked.json").write_text(
        json.dumps({"directions": directions.tolist(), "rows": rows, "poses": POSES}), encoding="utf-8"
    )
    (tmp_path / "craft.json").write_text(vehicle_summary_json(craft), encoding="utf-8")
    told = iter(json.loads(bare(JUDGE, str(tmp_path / "asked.json"), str(tmp_path / "craft.json"))))
    points = bow_ball(craft.bow_m, craft.camera_z_m, 0.4)
    calculator = WashSavingsCalculator(craft, directions)
    largest = 0.0
    for pose in POSES:
        view = influence_model(craft, points, np.ones(len(points)))
        gram = view.gram(Pose(np.array(pose[:3]), quat_from_euler(*pose[3:])))
        for pulses, volts in rows:
            savings = calculator.judge(np.array(pulses), calculator.supply_V(volts), gram)
            for share, (disturbance, thrusts_N) in zip(SHARES, next(told), strict=True):
                assert disturbance == pytest.approx(savings.disturbance[share], rel=1e-9, abs=1e-15)
                assert thrusts_N == pytest.approx(savings.thrusts_N[share], abs=1e-6)
                largest = max(largest, savings.disturbance[share])
    assert largest > 1e-6
    assert next(told, None) is None


def test_the_meters_whole_program_needs_numpy_and_pymavlink_only() -> None:
    """Every module that the small entry point imports, pymavlink's dialect too."""
    found = bare(
        "before = set(sys.modules)\n"
        "import wakewise_ardusub.wash_meter.embedded, pymavlink.dialects.v20.ardupilotmega\n"
        "print(sorted({m.partition('.')[0] for m in set(sys.modules) - before} - set(sys.stdlib_module_names)))"
    )
    assert set(json.loads(found.replace("'", '"'))) <= {"fastcrc", "numpy", "pymavlink", "wakewise", "wakewise_ardusub"}


def test_a_layout_that_needs_solvers_is_refused_by_a_small_computer(tmp_path: Path) -> None:
    """RexROV's spare thrusts are in one piece: one line says so, before anything is judged."""
    craft = VehicleSummary.of(load_vehicle("rexrov"), wake_model("jet"))
    assert not WashSavingsCalculator.is_small(craft)
    (tmp_path / "craft.json").write_text(vehicle_summary_json(craft), encoding="utf-8")
    code = """
from pathlib import Path
import numpy as np
from wakewise.core.errors import InputError
from wakewise_ardusub.vehicle_summary import read_vehicle_summary
from wakewise_ardusub.wash_savings import WashSavingsCalculator
craft = read_vehicle_summary(Path(sys.argv[1]))
try:
    WashSavingsCalculator(craft, np.ones(craft.count))
except InputError as fault:
    print(fault)
"""
    assert "64-bit computer" in bare(code, str(tmp_path / "craft.json"))


def test_saved_per_cent_is_of_something() -> None:
    """Half of it is 50; where points lie as good as still there is nothing to save."""
    assert saved_pct(2.0, 1.0, 15.0) == pytest.approx(50.0)
    assert saved_pct(1e-8, 0.0, 15.0) is None


def test_a_craft_goes_through_its_file(tmp_path: Path) -> None:
    """All numbers as they were; what is no craft file is refused with its name."""
    craft = VehicleSummary.of(load_vehicle("bluerov2"), wake_model("paper-calibrated"))
    path = tmp_path / "craft.json"
    path.write_text(vehicle_summary_json(craft), encoding="utf-8")
    again = read_vehicle_summary(path)
    for name in ("allocation_matrix", "positions_B_m", "axes_B", "areas_m2", "thrust_lower_N", "thrust_upper_N"):
        assert np.array_equal(getattr(again, name), getattr(craft, name)), name
    assert (again.name, again.thrusters, again.supply_V) == (craft.name, craft.thrusters, craft.supply_V)
    assert craft.curve is not None
    assert again.curve is not None
    pulses = np.arange(1050.0, 1960.0, 7.0)
    for volts in (10.0, 14.7, 20.0):
        assert np.array_equal(again.curve.thrust_N(pulses, volts), craft.curve.thrust_N(pulses, volts))
    whole = path.read_text(encoding="utf-8")
    for text, said in (
        ("", "cannot be read as a craft file"),
        ("[]", "format 'list'"),
        ('{"format": "wakewise craft 1", "curve": null}', "wake is missing"),
        (re.sub('"kind":.', '"kind":7', whole), "kernel 7"),
        (whole.replace('"bow_m":', '"bow_m":"a", "":'), "craft.json"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=said):
            read_vehicle_summary(path)
