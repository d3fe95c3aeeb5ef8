"""The core works where none of the extras' packages can be imported, and what needs one says so before it begins."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from wakewise.core.optional_dependencies import EXTRAS, how_to_install
from wakewise_ardusub.optional_dependencies import ARDUSUB

BLOCKED = sorted({module for modules in (*EXTRAS.values(), *ARDUSUB.extras.values()) for module in modules})
_WITHOUT = f"""
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {BLOCKED}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
"""


def without_extras(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run Python lines in a process of their own, in which no package of an extra can be imported.

    Processes that it starts are as it is.
    """
    place = folder / "blocked"
    place.mkdir()
    (place / "sitecustomize.py").write_text(_WITHOUT)
    return subprocess.run(
        [sys.executable, "-c", f"import sys\n{script}"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(place), os.environ.get("PYTHONPATH", "")])},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def test_packages_of_the_core_and_all_settings_are_imported_without_extras(tmp_path):
    """Scenario holds the settings of every package; the names of a lazy package that need no extra can be had."""
    found = without_extras(
        """
import wakewise, wakewise.vision.imaging, wakewise.vision.reconstruction, wakewise.ui.reports
import wakewise.experiments.trials
import wakewise.allocation, wakewise.control, wakewise.estimation, wakewise.robot.importers, wakewise.simulation.lattice
import wakewise.scene.missions, wakewise.planning, wakewise.simulation.tank, wakewise.scene.targets, wakewise.wake
import wakewise.robot.thrusters
import wakewise.api, wakewise.operation.parts, wakewise.operation.flying, wakewise.operation.recorder
import wakewise_paper.wash_reduction.flight, wakewise_paper.wake_validation, wakewise_benchmarks
import wakewise.ui.reports.vehicle, wakewise_nerf.field, wakewise.vision.reconstruction.photos.lenses
import wakewise.experiments.trials.export, wakewise.learning
from wakewise.vision.evaluation import flight_figures, umeyama
from wakewise.vision.imaging import ImagingSettings
from wakewise.operation import load_scenario
from wakewise.vision.reconstruction import read_cloud
load_scenario("quick", None, {})
""",
        tmp_path,
    )
    assert found.returncode == 0, found.stderr


@pytest.mark.slow
def test_an_environment_says_which_extra_it_needs(tmp_path):
    """Without Gymnasium the task can be had; an environment is refused in one line."""
    found = without_extras(
        """
from wakewise.core.errors import MissingExtra
from wakewise.learning import StationKeepingTask
StationKeepingTask()
try:
    from wakewise.learning import StationKeepingEnv
except MissingExtra as fault:
    print(fault)
""",
        tmp_path,
    )
    assert found.returncode == 0, found.stderr
    assert "wakewise.learning.StationKeepingEnv needs gymnasium" in found.stdout and "[learning]" in found.stdout


@pytest.mark.slow
def test_a_mission_is_planned_and_flown_without_extras(tmp_path):
    """Two seconds in the tank leave a whole steps.parquet."""
    found = without_extras(
        """
from pathlib import Path
import polars
import wakewise as ww
flight = ww.fly(ww.Scenario.preset("quick", **{"method": "dp", "target.points": 60}), duration_s=2.0)
flight.write(Path("."))
steps = polars.read_parquet("steps.parquet")
assert len(steps) == 100 and steps["time_s"][-1] > 1.9, steps
assert steps["target_speed_mean_m_s"].max() > 0.0
""",
        tmp_path,
    )
    assert found.returncode == 0, found.stderr


@pytest.mark.slow
def test_a_campaign_of_flights_is_made_without_extras(tmp_path):
    """`stages: fly` takes no photograph: its trials are flown and put in a table; `stages: model` is refused."""
    text = (
        "name: core\nmethods: [dp]\ntargets: [brain]\nworlds: [still-tank]\nseeds: 1\nretries: 0\n"
        "scenario: {mission.elevations_deg: [40], mission.views: [3], target.points: 60}\n"
    )
    (tmp_path / "fly.yaml").write_text(text + "stages: fly\n")
    (tmp_path / "model.yaml").write_text(text + "stages: model\n")
    found = without_extras(
        """
from wakewise.ui.cli.main import run
assert run("campaign run model.yaml --out model".split()) == 2
assert run("campaign run fly.yaml --out fly".split()) == 0
assert run("campaign table fly --write fly.csv --json".split()) == 0
""",
        tmp_path,
    )
    assert found.returncode == 0, found.stderr
    assert "a campaign of `stages: model` needs" in found.stderr
    assert not (tmp_path / "model").exists()
    (trial,) = (tmp_path / "fly" / "trials").glob("[!.]*")
    assert (trial / "work" / "steps.parquet").is_file()
    figures = json.loads((trial / "figures.json").read_text())["figures"]
    assert figures["target_speed_mean_m_s"] > 0.0


@pytest.mark.slow
def test_commands_of_the_core_run_without_extras(tmp_path):
    """Vehicles, allocation, the tank's flow and targets; the paper's planner can be imported."""
    names = ",".join(f"thrust_{i + 1}_N" for i in range(8))
    (tmp_path / "t.csv").write_text(f"time_s,{names}\n0,{','.join('1' * 8)}\n1,{','.join('1' * 8)}\n")
    (tmp_path / "p.csv").write_text("x_m,y_m,z_m\n0.3,0,0.2\n")
    (tmp_path / "w.csv").write_text("x_m,y_m,z_m,weight\n0.3,0.1,1.2,1\n")
    found = without_extras(
        """
import json
from contextlib import redirect_stdout
from io import StringIO
from wakewise.ui.cli.main import run
answers = {}
for words in (
    "vehicle check paper --json",
    "vehicle show paper --out v.html --json",
    "vehicle list --json",
    "allocate --pose 0 0 0.6 0 0 0 --wrench 2 -1 0 0 0 0.2 --points w.csv --json",
    "tank probe --thrusts t.csv --points p.csv --pose 0 0 0.2 0 0 0 --json",
    "target show plate --points 40 --json",
):
    with redirect_stdout(StringIO()) as out:
        code = run(words.split())
    assert code == 0, words
    answers[words.split(" --")[0]] = json.loads(out.getvalue())
from wakewise_benchmarks.paper_planner import PaperPlanner
print(json.dumps(answers))
""",
        tmp_path,
    )
    assert found.returncode == 0, found.stderr
    answers = json.loads(found.stdout)
    assert answers["target show plate"]["region_points"] == 40
    assert answers["allocate"]["gap"] <= 1e-5
    assert (tmp_path / "v.html").stat().st_size > 10_000


COMMANDS = {
    "scan --out runs/x": "photos,reports,logs",
    "compare --out runs/x": "photos,reports,logs",
    "reconstruct . --out runs/x": "photos",
    "evaluate cloud.ply --reference cloud.ply": "photos",
    "film runs/x": "photos,reports",
    "export runs/x --to rosbag2": "ros",
    "photo-robustness --out runs/x": "photos,reports",
    "calibrate .": "photos",
    "colour . --out runs/x": "photos",
    "nerf . --out runs/x": "nerf,photos",
    "target show plate --out runs/x.html": "reports,photos",
    "wake validate --quick --out runs/x": "reports",
    "bench gentle --plot runs/x.svg": "reports",
    "bench imaging": "photos",
}
CALLS = {
    "ww.trial(scenario, 'runs/x')": "photos,reports,logs",
    "ww.compare({'a': scenario, 'b': scenario}, 'runs/x')": "photos,reports,logs",
    "ww.reconstruct('.', 'runs/x')": "photos",
    "ww.evaluate('cloud.ply', 'mesh.ply')": "photos",
}
_EACH = f"""
import json
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
import wakewise as ww
from wakewise.core.errors import MissingExtra
from wakewise.ui.cli.main import run

scenario = ww.Scenario.preset("quick")
answers = {{}}
for words in {list(COMMANDS)}:
    with redirect_stderr(StringIO()) as said:
        code = run(words.split())
    answers[words] = [code, said.getvalue(), Path("runs").exists()]
for call in {list(CALLS)}:
    try:
        eval(call)
    except MissingExtra as refusal:
        answers[call] = [None, str(refusal), Path("runs").exists()]
Path("answers.json").write_text(json.dumps(answers))
"""


@pytest.fixture(scope="module")
def refusals(tmp_path_factory):
    """Exit code, words and whether something was written, of each command and call, all in one process."""
    folder = tmp_path_factory.mktemp("refusals")
    (folder / "cloud.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    found = without_extras(_EACH, folder)
    assert found.returncode == 0, found.stderr
    return json.loads((folder / "answers.json").read_text())


@pytest.mark.parametrize(("words", "extras"), COMMANDS.items())
def test_a_command_says_in_one_line_which_extra_it_needs(words, extras, refusals):
    """Exit code 2, the packages and how to install them; nothing is written."""
    code, said, written = refusals[words]
    assert code == 2, said
    (line,) = said.strip().splitlines()
    assert line.startswith("wakewise: ")
    assert f"pip install -e '.[{extras}]' (in the clone's folder)" in line
    assert not written


@pytest.mark.slow
def test_python_is_told_which_extra_a_name_needs(tmp_path):
    """The error of a lazy package is an ImportError too, and names the package and what it needs."""
    found = without_extras(
        """
from wakewise.core.errors import MissingExtra, WakewiseError
assert issubclass(MissingExtra, WakewiseError) and issubclass(MissingExtra, ImportError)
lines = []
for package, name in (
    ("vision.imaging", "Scene"), ("vision.reconstruction", "reconstruct"), ("ui.reports", "write_report"),
    ("experiments.trials", "run_trial"), ("operation", "photograph_flight"), ("ui.film", "write_film"),
):
    try:
        exec(f"from wakewise.{package} import {name}")
    except MissingExtra as refusal:
        lines.append(str(refusal))
        assert str(refusal).startswith(f"wakewise.{package}.{name} needs "), refusal
assert len(lines) == 6, lines
""",
        tmp_path,
    )
    assert found.returncode == 0, found.stderr


@pytest.mark.parametrize(("call", "extras"), CALLS.items())
def test_a_function_names_all_that_is_missing_before_it_begins(call, extras, refusals):
    """One line with every extra, not one after the other; nothing is written."""
    _, said, written = refusals[call]
    assert said.startswith(f"{call.partition('(')[0]} needs ")
    assert how_to_install(extras) in said
    assert not written


HEAVY = ("numpy", "scipy", "numba", "polars", "pydantic", "yaml", "rich", "matplotlib", "cv2", "trimesh")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "heavy"),
    [
        ("import wakewise", HEAVY),
        ("from wakewise.ui.cli.main import run\nassert run(['--help']) == 0", HEAVY),
        (
            "import wakewise.experiments.campaigns.worker, wakewise.experiments.campaigns.flights",
            ("cv2", "embreex", "pycolmap", "small_gicp", "PIL", "matplotlib", "trimesh"),
        ),
        (
            "from wakewise.operation import load_scenario\nload_scenario('quick', None, {})",
            ("polars", "rich", "cv2", "embreex", "pycolmap", "trimesh", "networkx", "skimage", "scipy.stats", "osqp"),
        ),
    ],
)
def test_what_takes_long_to_import_is_imported_when_it_is_needed(script, heavy, tmp_path):
    """`import wakewise`, the help of all commands, and a scenario read and checked."""
    found = subprocess.run(
        [sys.executable, "-c", f"import sys\n{script}\nprint('HEAVY', sorted(set({heavy}) & sys.modules.keys()))"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.splitlines()[-1] == "HEAVY []"
