"""A package from outside the source tree adds one of each part, by entry points and by `package.module:name`."""

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import wakewise as ww
from wakewise.core import plugins
from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run

ENTRY_POINTS = """
[wakewise.controllers]
stern-only = reef_parts:stern_only
[wakewise.wake_models]
top-hat = reef_parts:TopHat
[wakewise.vehicle_formats]
mass = reef_parts:read_mass_file
[wakewise.targets]
pyramid = reef_parts:pyramid
[wakewise.pilots]
hover = reef_parts:hover
[wakewise.worlds]
quiet-tank = reef_parts:quiet_tank
[wakewise.currents]
tide = reef_parts:Tide
"""
LATE = r"stern-only: late, \d+ ms of \d+ allowed"
"""What a flight says of a controller from outside on a busy computer: its time is the clock's."""
SMALL = {
    "world": "tank",
    "mission.elevations_deg": [40],
    "mission.views": [3],
    "mission.speed_m_s": 0.5,
    "mission.acceleration_m_s2": 0.5,
    "mission.settle_s": 0.5,
    "imaging.width": 160,
    "imaging.height": 120,
    "target.kind": "brain",
    "target.points": 60,
}
"""Three photographs: whether they make a model does not matter to whose controller it was."""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The package as pip would leave it, on a path of its own."""
    site = tmp_path / "site"
    site.mkdir()
    shutil.copy(Path(__file__).with_name("reef_parts.py"), site)
    about = site / "reef_parts-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: reef-parts\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(site))
    plugins._offered.cache_clear()
    yield site
    plugins._offered.cache_clear()
    sys.modules.pop("reef_parts", None)


def test_each_kind_is_found_by_its_name(installed: Path, tmp_path: Path) -> None:
    """A scenario names them as it names ours; the parts are theirs, and every one of them is said to be."""
    (tmp_path / "heavy.mass").write_text("14.0")
    scenario = ww.Scenario.preset(
        "quick",
        **{
            "method": "stern-only",
            "vehicle": str(tmp_path / "heavy.mass"),
            "world": "quiet-tank",
            "pilot": "hover",
            "target.kind": "pyramid",
            "target.points": 60,
            "control.wake.model": "top-hat",
            "tank.current.file": "tide",
        },
    )
    assert "stern-only" in ww.methods()
    parts = scenario.parts()
    assert (parts.vehicle.name, parts.vehicle.mass_kg) == ("heavy", 14.0)
    assert (parts.target.name, parts.wake.name, parts.world.name) == ("pyramid", "top-hat", "quiet-tank")
    flight = ww.fly(parts, duration_s=2.0)
    told = [words for words in flight.steps["fallback"].drop_nulls() if words]
    assert flight.parts.method == "stern-only" and all(re.fullmatch(LATE, words) for words in told)
    assert set(parts.external_parts) == {"controller", "wake", "world", "pilot", "target", "vehicle", "current"}
    assert "reef-parts 1.0" in parts.external_parts["controller"]
    assert "differences" in parts.external_parts["wake"]
    goals = flight.steps.select("goal_x_m", "goal_y_m", "goal_z_m").to_numpy()
    assert np.ptp(goals, axis=0).max() == 0.0
    bow = flight.steps.select("command_1_N", "command_2_N", "command_3_N", "command_4_N").to_numpy()
    forward = [i for i, T in enumerate(parts.vehicle.thrusters) if T.p_BT_m[0] > 0 and abs(T.axis_B[2]) < 0.5]
    astern = bow[:, forward] * np.array([parts.vehicle.thrusters[i].axis_B[0] for i in forward])
    assert astern.min() >= -1e-9


@pytest.mark.slow
def test_a_planner_that_believes_in_a_foreign_wake_keeps_it_off_the_target(installed: Path) -> None:
    """Without gradients of its own the model still steers plan and shares; D falls against the least thrusts."""
    scenario = ww.Scenario.preset("quick", **{"control.wake.model": "reef_parts:TopHat", "target.points": 60})
    parts = scenario.parts()
    flight = ww.fly(parts, duration_s=1.5)
    assert flight.parts.wake.name == "top-hat"
    assert flight.steps["fallback"].str.contains("raised").sum() == 0
    assert "by central differences" in parts.external_parts["wake"]


@pytest.mark.slow
def test_the_foreign_controllers_trial_says_so(installed: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Scenario, figures, report and comparison name the method and that it came from outside."""
    sets = [word for key, value in SMALL.items() for word in ("--set", f"{key}={json.dumps(value)}")]
    out = tmp_path / "both"
    assert run(["compare", "--methods", "stern-only,dp", "--out", str(out), *sets, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert set(figures["methods"]) == {"stern-only", "dp"}
    assert "reef-parts 1.0" in figures["methods"]["stern-only"]["from_outside"]["controller"]
    assert "method: stern-only" in (out / "stern-only" / "scenario.yaml").read_text()
    for page in (out / "stern-only" / "report.html", out / "comparison.html"):
        text = page.read_text(encoding="utf-8")
        assert "stern-only" in text and "from outside" in text, page


def test_a_part_given_in_python_is_named_in_the_record(installed: Path, tmp_path: Path) -> None:
    """A controller object replaces the scenario's method; the scenario left behind says so."""
    import reef_parts

    from wakewise.control import ControlTask
    from wakewise.operation.trial_folder import resolved_scenario

    parts = ww.Scenario.preset("quick").parts()
    task = ControlTask(vehicle=parts.vehicle, region=parts.region, wake=parts.wake, settings=parts.control)
    mine = parts.replace(controller=reef_parts.stern_only(task))
    left = resolved_scenario(mine)
    assert left.method == "stern-only"
    assert left.overrides == {"controller": "stern-only (reef_parts.SternOnly)"}
    assert ww.Scenario.model_validate(left.model_dump()) == left


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"method": "reef_parts:nothing"}, "cannot be loaded, AttributeError"),
        ({"method": "no_such_package:make"}, "cannot be loaded, ModuleNotFoundError"),
        ({"method": "stern-onli"}, "did you mean stern-only"),
        ({"world": "moon"}, "sheltered, still-tank, quiet-tank"),
        ({"control.wake.model": "top-cat"}, "top-hat"),
        ({"target.kind": "pyramids"}, "pyramids"),
    ],
)
def test_what_is_not_there_is_said_in_one_line(installed: Path, changes: dict, words: str) -> None:
    """A wrong name is told what there is; what cannot be imported is told why."""
    with pytest.raises(InputError, match=words) as caught:
        parts = ww.Scenario.preset("quick", **changes).parts()
        _ = parts.target, parts.wake, parts.world, parts.controller
    assert "\n" not in str(caught.value)
