"""A command and the function of the Python API that answers the same question answer it alike."""

import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wakewise as ww
from wakewise.control.settings import ControlSettings
from wakewise.operation import Scenario
from wakewise.ui.cli.allocate import allocate as allocate_command
from wakewise.ui.cli.evaluate import evaluate as evaluate_command
from wakewise.ui.cli.main import run
from wakewise.ui.cli.reconstruct import reconstruct_photos
from wakewise_ardusub.ros import ThrustAllocator

POSE, WRENCH = [-0.6, 0.0, 1.3, 0.0, 0.1, 0.6], [-8.0, 1.0, 2.0, 0.0, 0.2, 0.3]
PLACES, WEIGHTS = [[0.0, 0.0, 1.4], [0.1, 0.05, 1.35], [-0.05, 0.1, 1.5]], [1.0, 0.5, 2.0]


def by_command(capsys: pytest.CaptureFixture[str], folder: Path, vehicle: str, *more: str) -> dict[str, Any]:
    """What `wakewise allocate --json` prints for the wrench of this page."""
    rows = [",".join(map(str, [*place, weight])) for place, weight in zip(PLACES, WEIGHTS, strict=True)]
    (folder / "p.csv").write_text("\n".join(["x_m,y_m,z_m,weight", *rows]) + "\n")
    words = ["--vehicle", vehicle, "--pose", *map(str, POSE), "--wrench", *map(str, WRENCH)]
    assert run(["allocate", *words, "--points", str(folder / "p.csv"), "--json", *more]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def by_function(vehicle: str, **more: Any) -> Any:
    """What `ww.allocate` answers to the same."""
    from wakewise.scene.targets import Region

    region = Region(points_W_m=np.array(PLACES), weights=np.array(WEIGHTS), distance_m=np.zeros(3))
    return ww.allocate(ww.load_vehicle(vehicle), WRENCH, POSE, region, **more)


@pytest.mark.parametrize("vehicle", ["bluerov2-heavy", "paper"])
@pytest.mark.parametrize(
    ("words", "more"),
    [
        ([], {}),
        (["--sum", "incoherent"], {"superposition": "incoherent"}),
        (["--wake-model", "learned"], {"wake": "learned"}),
        (["--w-disturbance", "3", "--w-effort", "0.01"], {"w_disturbance": 3.0, "w_effort": 0.01}),
        (["--failed", "2", "--priority", "ZKMN,XY"], {"failed": [1], "priority": "ZKMN,XY"}),
        (["--w-previous", "1", "--previous", "1,0,0,0,0,0,0,0"], {"w_previous": 1.0, "previous_N": np.eye(8)[0]}),
    ],
    ids=["defaults", "sum", "model", "weights", "failed", "previous"],
)
def test_allocate_answers_as_the_function(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, vehicle: str, words: list[str], more: dict[str, Any]
) -> None:
    """The same thrusts, D, scale and gap, by default and with every option."""
    told, found = by_command(capsys, tmp_path, vehicle, *words), by_function(vehicle, **more)
    np.testing.assert_allclose(told["thrusts_N"], found.thrusts_N, atol=1e-9)
    assert told["disturbance"] == pytest.approx(found.disturbance, rel=1e-9, abs=1e-15)
    assert (told["scale"], told["method"]) == (found.scale, found.method)
    assert told["given_up"] == pytest.approx(found.given_up)


def test_thrusters_are_named_alike(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A failed thruster's name means the same in both; numbers of the command are those of its table, from 1."""
    names = [thruster.name for thruster in ww.load_vehicle("paper").thrusters]
    told = by_command(capsys, tmp_path, "paper", "--failed", names[2], "--failed", "5")
    assert told["failed"] == [names[2], names[4]]
    np.testing.assert_allclose(told["thrusts_N"], by_function("paper", failed=[names[2], names[4]]).thrusts_N)
    np.testing.assert_allclose(told["thrusts_N"], by_function("paper", failed=[2, 4]).thrusts_N)


SAME_NAME = {
    "wrench_B": "wrench",
    "region": "points",
    "wake": "wake_model",
    "previous_N": "previous",
    "bed_z_m": "bed_z",
}
SAME_NAME |= {"superposition": "sum_"}
NOT_ASKED = (None, (), inspect.Parameter.empty)


@pytest.mark.parametrize(
    ("command", "function"),
    [
        (allocate_command, ww.allocate),
        (evaluate_command, ww.evaluate),
        (reconstruct_photos, ww.reconstruct),
    ],
    ids=["allocate", "evaluate", "reconstruct"],
)
def test_defaults_of_a_command_are_those_of_its_function(command: Any, function: Any) -> None:
    """Whatever both can be told, they take for granted alike; what is left out is left out of both."""
    theirs = inspect.signature(command).parameters
    shared = 0
    for name, parameter in inspect.signature(function).parameters.items():
        there = theirs.get(SAME_NAME.get(name, name))
        if there is None or there.name in ("vehicle", "out"):  # a place to write to, and a library's first vehicle
            continue
        shared += 1
        if parameter.default in NOT_ASKED:
            assert there.default in NOT_ASKED, name
        else:
            assert there.default == parameter.default, name
    assert shared >= 3
    if "icp" in inspect.signature(function).parameters:
        assert inspect.signature(function).parameters["icp"].default is not theirs["no_icp"].default


def test_a_flight_and_a_single_wrench_have_the_same_weights() -> None:
    """Scenario, command, function and ROS node: one weight of the water and one of effort, by default."""
    control, scenario = ControlSettings(), Scenario().control
    defaults = inspect.signature(ww.allocate).parameters
    told = (defaults["w_disturbance"].default, defaults["w_effort"].default)
    assert told == (control.w_disturbance, control.w_effort) == (scenario.w_disturbance, scenario.w_effort)
    node = ThrustAllocator(vehicle=ww.load_vehicle("paper"), wake=ww.wake_model("jet")).weights
    assert told == (node.disturbance, node.effort)


def test_what_is_printed_at_home_is_what_a_flight_would_do() -> None:
    """A flight's own weights at a pose of its mission give the thrusts of `ww.allocate` with nothing said."""
    from wakewise.allocation import min_wash_allocation
    from wakewise.control import vehicle_layout
    from wakewise.control.null_space_allocation import weights_of
    from wakewise.wake import InfluenceModel

    parts = ww.Scenario.preset("quick").parts()
    view = InfluenceModel.of(parts.vehicle, parts.region, parts.wake)
    weights = weights_of(parts.control, view.total_weight)
    gram, before = view.gram(parts.start.X_WB), np.zeros(8)
    flown = min_wash_allocation(vehicle_layout(parts.vehicle), np.array(WRENCH), gram, weights, before)
    asked = ww.allocate(
        parts.vehicle,
        WRENCH,
        parts.start.X_WB,
        parts.region,
        parts.wake,
        w_previous=weights.previous,
        previous_N=before,
    )
    np.testing.assert_allclose(asked.thrusts_N, flown.thrusts_N, atol=1e-9)
