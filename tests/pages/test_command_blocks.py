"""Every command line of README and docs is run, or it says why not."""

from __future__ import annotations

import csv
import os
import re
import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from command_blocks import ROOT, Line, command_lines

from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run

SHORT = [
    "mission.elevations_deg=[40]",
    "mission.views=[3]",
    "mission.settle_s=0.5",
    "mission.speed_m_s=0.2",
    "imaging.width=160",
    "imaging.height=120",
    "target.points=60",
]
"""A mission of three small photographs: whether they make a model does not matter to whether the line works."""
PATIENCE_S = 120.0
"""How long a program may take to say that it is ready: it may have to compile."""
OWN = "a folder of the line's own"
BRIEF = [word for field in SHORT for word in ("--set", field)]


@dataclass(frozen=True)
class Run:
    """Lines that are run in a folder that holds the files that they name; `also` shortens them."""

    pattern: str
    also: tuple[str, ...] = ()
    slow: bool = False
    shows: str = ""
    """What the output matches."""


@dataclass(frozen=True)
class Start:
    """Programs that run until they are stopped: started, heard until they say `shows`, then interrupted."""

    pattern: str
    shows: str
    also: tuple[str, ...] = ()
    code: int = 0
    """Exit code after the interrupt."""


@dataclass(frozen=True)
class Elsewhere:
    """Lines whose command another test runs, since it needs a stand-in, special photographs, or hours."""

    pattern: str
    test: str
    words: str
    """What that test's file holds, so that it is seen if the command is no longer run there."""


@dataclass(frozen=True)
class Never:
    """Lines that no test can run, and why."""

    pattern: str
    why: str


RULES: list[Run | Start | Elsewhere | Never] = [
    # Before anything can be run.
    Never(
        r"make (setup|check|test|test-all|docs|notebooks|coverage|bench-history|nightly)",
        "this test runs in what `make setup` made, as part of `make test`",
    ),
    Never(
        r"pip install pre-commit|pre-commit install", "changes a clone's hooks; its checks are those of `make check`"
    ),
    Never(r"podman (build|run) .*", "no container program among Debian's and Python's packages that tests may ask for"),
    Never(r"\. \.venv/bin/activate", "this test runs in the environment already"),
    Never(r"pip install .*", "installs packages; tests/test_core.py and the lock file's test judge what is installed"),
    # Flights, photographs, models.
    Run(r"wakewise scan --target branching", also=(*BRIEF, "--json"), slow=True, shows=r'"registered_images"'),
    Run(r"wakewise scan( --world reef( --seed 3)?)?", also=(*BRIEF, "--out", OWN), slow=True),
    Run(r"wakewise scan --method \S+( --set \S+)?", also=(*BRIEF, "--out", OWN), slow=True),
    Run(r"wakewise scan --target colony\.ply .*", also=tuple(BRIEF), slow=True),
    Run(r"wakewise scan --set tank\.current\.velocity_m_s=.*", also=tuple(BRIEF), slow=True),
    Run(r"wakewise scan --resume runs/FOLDER", slow=True),
    Run(r"wakewise compare( .*--methods dp,wake-aware)?", also=(*BRIEF, "--out", OWN), slow=True),
    Run(r"wakewise film runs/\w+", slow=True),
    Run(r"wakewise export runs/colony --to nerfstudio", slow=True),
    Elsewhere(r"wakewise export .*--to dataset.*", "tests/experiments/trials/dataset/test_dataset.py", '"dataset"'),
    Run(r"wakewise reconstruct PHOTOS( .*)?", slow=True, shows="verdict"),
    Elsewhere(r"wakewise reconstruct photos/ .*--bar .*", "tests/vision/reconstruction/test_scale_stage.py", "bars"),
    Elsewhere(r"wakewise reconstruct \w+/ .*--fixes .*", "tests/vision/reconstruction/test_scale_by_fixes.py", "fixes"),
    Never(r"wakewise reconstruct runs/sea-.*", "needs the photographs of a real dive; PHOTOS stand for them above"),
    Elsewhere(r"wakewise photos pick .*", "tests/vision/photo_selection/test_photo_pick.py", '"photos", "pick"'),
    Elsewhere(
        r"wakewise reconstruct runs/picked-PHOTOS.*",
        "tests/vision/photo_selection/test_photo_pick.py",
        "read_reference_cameras",
    ),
    Run(r"wakewise evaluate .*", also=("--bed-z", "1.5"), slow=True, shows="rmse_mm"),  # truth.ply has no bed
    Run(r"wakewise measure runs/metres.*", slow=True, shows="volume_cm3"),
    Elsewhere(r"wakewise compare-models runs/spring .*", "tests/ui/cli/test_measure_commands.py", '"compare-models"'),
    Run(r"wakewise calibrate BOARD_PHOTOS .*", slow=True, shows="focal"),
    Run(r"wakewise colour PHOTOS"),
    Run(r"wakewise photo-robustness", also=("--levels", "silt=0", "--out", "runs/degraded", *BRIEF), slow=True),
    Elsewhere(r"wakewise nerf .*", "packages/wakewise-nerf/tests/test_nerf_pipeline.py", '"nerf"'),
    # Vehicles, wakes, water, worlds.
    Run(r"wakewise vehicle check bluerov2-heavy", shows="rank"),
    Run(r"wakewise vehicle show bluerov2-heavy --out rov\.html"),
    Run(r"wakewise vehicle import my_rov\.urdf --out my_rov\.yaml --like bluerov2-heavy"),
    Elsewhere(
        r"wakewise (vehicle|scan) .*my_(whole_)?rov\.(urdf|yaml).*",
        "tests/ui/cli/test_vehicle_newcomer.py",
        "vehicle-file.md",
    ),
    Run(r"wakewise vehicle trim bluerov2-heavy", slow=True),
    Run(r"wakewise vehicle thruster --thrust 5", shows="us"),
    Run(r"printf .*> points\.csv"),
    Run(r"wakewise allocate .*", shows="disturbance"),
    Run(r"wakewise wake fit piv\.csv --out wake\.yaml"),
    Run(r"wakewise wake validate --out runs/wake", slow=True),
    Run(r"wakewise tank probe --help", shows="--points"),
    Run(r"wakewise world (list|show reef( --seed 3)?)", shows="reef"),
    # Studies: minutes to hours; tests run each with a few seconds of flight.
    Run(r"wakewise bench allocator", slow=True),
    Elsewhere(
        r"wakewise bench operator.*", "packages/wakewise-paper/tests/operator_study/test_operator_bench.py", "operator"
    ),
    Elsewhere(r"wakewise scan --set pilot=find.*", "tests/operation/finding/test_find_pilot.py", 'pilot="find"'),
    Elsewhere(r"wakewise scan --preset reef.*", "tests/operation/finding/test_survey_pilot.py", 'preset("reef"'),
    Elsewhere(r"python examples/learned_policy\.py", "tests/test_examples.py", "learned_policy.py"),
    Elsewhere(r"wakewise bench learning.*", "benchmarks/tests/test_learning_bench.py", '"learning"'),
    Elsewhere(r"wakewise bench reef.*", "benchmarks/tests/test_reef_bench.py", "patch_figures"),
    Elsewhere(r"wakewise bench target.*", "benchmarks/tests/test_target_bench.py", "figures_of"),
    Elsewhere(r"wakewise bench truth.*", "benchmarks/tests/test_truth_bench.py", '"truth"'),
    Elsewhere(r"wakewise bench worlds.*", "packages/wakewise-paper/tests/world_study/test_worlds_bench.py", "worlds"),
    Elsewhere(
        r"wakewise bench gentle.*", "packages/wakewise-paper/tests/wash_reduction/test_gentle_bench.py", "gentle"
    ),
    Elsewhere(r"wakewise reproduce .*", "packages/wakewise-paper/tests/cli/test_reproduce_command.py", '"reproduce"'),
    # Campaigns.
    Run(r"wakewise campaign (run first\.yaml|(status|table|page) runs/first-comparison.*)", slow=True),
    Never(r"#SBATCH .*", "read by Slurm, which is not here"),
    Never(
        r"wakewise campaign run .*/shared/.*",
        "the folder /shared of a cluster is not here; the same command runs above",
    ),
    Never(
        r"export DASK_.*", "a setting of Dask's; tests/experiments/campaigns/test_cluster.py starts a scheduler with it"
    ),
    Elsewhere(r"dask (scheduler|worker) .*", "tests/experiments/campaigns/test_cluster.py", "scheduler"),
    # Programs that run until they are stopped, and real vehicles: tests run them against stand-ins on loopback.
    Never(r"wakewise cockpit .*--gamepad", "needs a gamepad; tests/operation/input flies with SDL's virtual one"),
    Start(r"wakewise cockpit", "http://127.0.0.1:", also=("--no-browser", "--port", "0")),
    Run(r"wakewise link log dive\.tlog", slow=True),
    Start(r"wakewise link wash-meter .*", "http://127.0.0.1:", also=("--port", "0")),
    Never(
        r"wakewise link sensors .*", "needs a companion's buses; packages/wakewise-ardusub/tests/sensors imitates them"
    ),
    Run(r"wakewise link install-script --out scripts.*"),
    Elsewhere(
        r"wakewise link install-script --upload .*",
        "packages/wakewise-ardusub/tests/cli/test_link_wire_commands.py",
        "--upload",
    ),
    Elsewhere(
        r"wakewise link ardusub --check .*", "packages/wakewise-ardusub/tests/cli/test_link_wire_commands.py", "--check"
    ),
    Elsewhere(
        r"wakewise link ardusub --motor-test .*",
        "packages/wakewise-ardusub/tests/cli/test_link_wire_commands.py",
        "--motor-test",
    ),
    Start(r"wakewise link ardusub .*", "heartbeat"),
    Elsewhere(
        r"wakewise link transect .*", "packages/wakewise-ardusub/tests/cli/test_link_transect_command.py", '"transect"'
    ),
    Elsewhere(
        r"wakewise link orbit .*", "packages/wakewise-ardusub/tests/cli/test_link_transect_command.py", '"orbit"'
    ),
    Elsewhere(r"wakewise bench survey.*", "benchmarks/tests/test_survey_bench.py", '"survey"'),
    Start(r"wakewise link sitl .*", "now start the firmware"),
    Start(r"wakewise link route", "shares udpin"),
    Start(r"wakewise link sitl-autopilot .*", "MANUAL|ALT_HOLD"),
    Never(
        r"(ardusub|WAKEWISE_ARDUSUB=\S+ pytest) .*",
        "needs the firmware's binary; tests marked sitl run it where there is one",
    ),
    Never(
        r"echo .*\| nc .*",
        "netcat is no part of every machine; the tests of sensors (test_line_poses.py) send the same line",
    ),
    # Other systems.
    Never(
        r"(OWNER=|docker |git tag |python tools/write_blueos\.py ).*",
        "needs Docker and an owner; packages/wakewise-ardusub/tests/blueos checks what is built",
    ),
    Never(
        r"(ln -s|ros2|python3 -m venv --system-site-packages) .*",
        "needs ROS 2; packages/wakewise-ardusub/tests/ros runs the node with imitated ROS",
    ),
]
"""The first whose pattern matches a whole line is the line's."""


def rule_of(line: Line) -> Run | Start | Elsewhere | Never | None:
    """The rule of a line; None if it has none."""
    return next((rule for rule in RULES if re.fullmatch(rule.pattern, line.words)), None)


LINES = command_lines()


# Files that the lines name, each made when a line needs it.


def _photographs(folder: Path) -> None:
    import wakewise as ww
    from wakewise.scene.targets import write_mesh
    from wakewise_paper.photo_sets import planned_views, write_photos

    mission = {"mission.elevations_deg": [45], "mission.views": [12], "mission.standoff_m": 0.4}
    scenario = ww.Scenario.preset("quick", **mission, **{"imaging.width": 320, "imaging.height": 240})
    target = scenario.parts().target
    views = planned_views(target, scenario.mission, scenario.imaging.exposure_s, np.random.default_rng(1))
    write_photos(folder / "made", views, None, scenario.imaging, target)
    shutil.copytree(folder / "made" / "images", folder / "PHOTOS")
    shutil.copytree(folder / "made" / "images", folder / "photos")
    shutil.copy(folder / "made" / "poses.csv", folder / "cameras.csv")
    write_mesh(folder / "truth.ply", target.mesh)
    camera = scenario.imaging.camera()
    with (folder / "made" / "poses.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = ["name", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"]
    lens = {"width": 320, "height": 240, "fx": camera.focal_px, "fy": camera.focal_px, "cx": 160.0, "cy": 120.0}
    lens |= dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    with (folder / "RIG").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*names, *lens])
        writer.writeheader()
        writer.writerows({name: row[name] for name in names} | lens for row in rows)


def _board_photographs(folder: Path) -> None:
    import cv2

    (folder / "BOARD_PHOTOS").mkdir()
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
    printed = cv2.aruco.CharucoBoard((11, 8), 0.008, 0.006, dictionary).generateImage((1100, 800))
    K = np.array([[700.0, 0, 319.5], [0, 700.0, 239.5], [0, 0, 1]])
    to_board = np.array([[8e-5, 0, 4e-5], [0, 8e-5, 4e-5], [0, 0, 1]])
    turns = [(0, 25, 0), (25, 0, 10), (-25, 10, 0), (10, -28, -15), (-18, -18, 5), (20, 20, 90)]
    for k, turn in enumerate(turns):
        R = cv2.Rodrigues(np.radians(np.array(turn, dtype=float)))[0]
        t = np.array([0.0, 0.0, 0.17]) - R @ [0.044, 0.032, 0.0]
        H = K @ np.column_stack([R[:, 0], R[:, 1], t]) @ to_board
        photo = cv2.warpPerspective(printed, H, (640, 480), flags=cv2.INTER_AREA, borderValue=200)
        cv2.imwrite(str(folder / "BOARD_PHOTOS" / f"{k}.png"), cv2.GaussianBlur(photo, (0, 0), 0.7))


def _velocities(folder: Path) -> None:
    from wakewise.wake.models import WakeSettings, wake_model

    rng = np.random.default_rng(0)
    distance, angle = rng.uniform(0.1, 0.5, 300), rng.uniform(0.0, 0.5, 300)
    thrust = np.repeat([1.0, 2.0, 4.0], 100)
    x, r = distance * np.cos(angle), distance * np.sin(angle)
    speed = wake_model(WakeSettings(model="jet", floor=False)).speed(x, r, thrust, 0.25 * np.pi * 0.06**2)
    rows = [f"{a},{b},{t},{u},0.06" for a, b, t, u in zip(x, r, thrust, speed, strict=True)]
    (folder / "piv.csv").write_text("\n".join(["x_m,r_m,thrust_N,u_m_s,disk_diameter_m", *rows]) + "\n")


def _robot(folder: Path) -> None:
    links = [
        (1, 1, 0, -0.7854), (1, -1, 0, 0.7854), (-1, 1, 0, -2.3562), (-1, -1, 0, 2.3562),
        (1, 1, 1, 0), (1, -1, 1, 0), (-1, 1, 1, 0), (-1, -1, 1, 0),
    ]  # fmt: skip
    parts = []
    for k, (x, y, up, yaw) in enumerate(links):
        pitch = -1.5708 if up else 0.0
        parts.append(
            f'<link name="thruster_{k}"/><joint name="j{k}" type="continuous"><parent link="base_link"/>'
            f'<child link="thruster_{k}"/><origin xyz="{0.15 * x} {0.1 * y} {0.05 * up}" rpy="0 {pitch} {yaw}"/>'
            '<axis xyz="1 0 0"/></joint><gazebo><plugin filename="gz-sim-thruster-system" '
            f'name="gz::sim::systems::Thruster"><joint_name>j{k}</joint_name>'
            "<thrust_coefficient>0.02</thrust_coefficient><propeller_diameter>0.1</propeller_diameter>"
            "</plugin></gazebo>"
        )
    (folder / "my_rov.urdf").write_text(
        '<robot name="my_rov" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base_link"><inertial>'
        '<mass value="11"/><inertia ixx="0.2" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f"{''.join(parts)}</robot>"
    )


def _log(folder: Path) -> None:
    from made_logs import tlog

    (folder / "dive.tlog").write_bytes(tlog())


def _colony(folder: Path) -> None:
    import trimesh

    trimesh.creation.icosphere(3, 40.0).export(folder / "colony.ply")


def _trial(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        assert run(["scan", "--out", f"runs/{name}", *BRIEF]) == 0

    return make


def _campaign(folder: Path) -> None:
    done = subprocess.run(["wakewise", "campaign", "example"], capture_output=True, text=True, check=True, cwd=folder)
    text = done.stdout.replace("stages: model", "stages: fly")
    (folder / "first.yaml").write_text(text)


def _packages(folder: Path) -> None:
    shutil.copy(ROOT / "tests" / "cookbook" / "reef_parts.py", folder)
    (folder / "my_package").mkdir()
    (folder / "my_package" / "__init__.py").touch()
    (folder / "my_package" / "module.py").write_text("from reef_parts import stern_only as make\n")


def _lines(*words: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        assert run(list(words)) == 0

    return make


MADE: dict[str, Callable[[Path], None]] = {
    "PHOTOS": _photographs,
    "photos": _photographs,
    "BOARD_PHOTOS": _board_photographs,
    "piv.csv": _velocities,
    "my_rov.urdf": _robot,
    "dive.tlog": _log,
    "colony.ply": _colony,
    "first.yaml": _campaign,
    "my_package": _packages,
    "reef_parts": _packages,
    "runs/FOLDER": _trial("FOLDER"),
    "runs/colony": _trial("colony"),
    "runs/reef": _trial("reef"),
    "runs/first-comparison": _lines("campaign", "run", "first.yaml"),
    "runs/metres": _lines("reconstruct", "PHOTOS", "--out", "runs/metres", "--reference-cameras", "cameras.csv"),
    "reef-2026": _lines("export", "runs/reef", "--to", "dataset", "--out", "reef-2026"),
}
"""Files and folders by the name that pages give them."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which all lines are run, one after the other."""
    return tmp_path_factory.mktemp("pages")


def prepare(words: str, folder: Path) -> None:
    """Make the files that a line names and that are not there, but those that it writes itself."""
    written = {word for word, before in zip(words.split()[1:], words.split(), strict=False) if before == "--out"}
    for name, make in MADE.items():
        named = re.search(rf"(?<![\w/-]){re.escape(name)}(?![\w-])", words)
        if named and name not in written and not (folder / name).exists() and not (folder / f"{name}.py").exists():
            prepare(PREREQUISITES.get(name, ""), folder)
            make(folder)


PREREQUISITES = {
    "runs/first-comparison": "first.yaml",
    "runs/metres": "PHOTOS",
    "reef-2026": "runs/reef",
}
"""What has to be there before a file or folder can be made."""


@pytest.mark.parametrize(
    "line",
    [
        pytest.param(line, id=f"{line.page}:{line.number}", marks=[pytest.mark.slow] if rule.slow else [])
        for line in LINES
        if isinstance(rule := rule_of(line), Run)
    ],
)
def test_a_line_of_a_page_does_what_it_says(
    line: Line, bench: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The command ends with exit code 0, in a folder that holds the files that the page speaks of."""
    rule = rule_of(line)
    assert isinstance(rule, Run)
    monkeypatch.chdir(bench)
    monkeypatch.syspath_prepend(str(bench))
    monkeypatch.setenv("PATH", f"{ROOT / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}")
    prepare(line.words, bench)
    capfd.readouterr()
    if line.words.startswith("wakewise "):
        own = f"runs/{Path(line.page).stem}-{line.number}"
        code = run([*shlex.split(line.words)[1:], *(own if word == OWN else word for word in rule.also)])
    else:
        code = subprocess.run(["sh", "-c", line.words], check=False, cwd=bench).returncode
    shown = capfd.readouterr()
    assert code == 0, shown.err[-2000:]
    assert re.search(rule.shows, shown.out), shown.out[-2000:]


def _camera_programs(bench: Path) -> Path:
    """A folder with a program that a page's camera calls, for computers without it; no photograph is taken here."""
    program = bench / "programs" / "ffmpeg"
    program.parent.mkdir(exist_ok=True)
    program.write_text("#!/bin/sh\nexit 1\n")
    program.chmod(0o755)
    return program.parent


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [pytest.param(line, id=f"{line.page}:{line.number}") for line in LINES if isinstance(rule_of(line), Start)],
)
def test_a_program_of_a_page_starts_and_ends_when_it_is_stopped(line: Line, bench: Path) -> None:
    """It says that it is ready, goes on, and ends with its own exit code after Ctrl-C."""
    rule = rule_of(line)
    assert isinstance(rule, Start)
    told = line.words.replace("0.0.0.0", "127.0.0.1")  # tests listen on loopback only
    words = [str(ROOT / ".venv" / "bin" / "wakewise"), *shlex.split(told)[1:], *rule.also]
    heard, around = (
        bench / "heard.txt",
        os.environ | {"PATH": f"{os.environ['PATH']}{os.pathsep}{_camera_programs(bench)}"},
    )
    with heard.open("w") as out:
        program = subprocess.Popen(
            words,
            cwd=bench,
            env=around,
            stdin=subprocess.PIPE,
            stdout=out,
            stderr=subprocess.STDOUT,
        )
        try:
            until = time.monotonic() + PATIENCE_S
            while not re.search(rule.shows, heard.read_text(errors="replace")):
                assert program.poll() is None and time.monotonic() < until, heard.read_text(errors="replace")[-2000:]
                time.sleep(0.2)
            program.send_signal(signal.SIGINT)
            assert program.wait(PATIENCE_S) == rule.code, heard.read_text(errors="replace")[-2000:]
        finally:
            program.kill()
            program.communicate()  # which closes its input, too


def test_every_line_of_a_page_is_run_or_says_why_not() -> None:
    """A new line needs a rule, a rule needs a line, and a test that is named runs the command."""
    without = [f"{line.page}:{line.number}: {line.words}" for line in LINES if rule_of(line) is None]
    assert without == []
    used = {id(rule_of(line)) for line in LINES}
    assert [rule.pattern for rule in RULES if id(rule) not in used] == []
    for rule in RULES:
        if isinstance(rule, Elsewhere):
            assert rule.words in (ROOT / rule.test).read_text(encoding="utf-8"), rule
        if isinstance(rule, Never):
            assert len(rule.why) > 10, rule


def test_scans_of_a_page_go_to_folders_of_their_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Run one after the other, no line of the how-to page is refused for what a line before it left."""
    folders: list[Path] = []

    def told(_: object, folder: Path, *__: object) -> None:
        folders.append(folder)
        raise InputError("nothing is flown")

    monkeypatch.setattr("wakewise.api.trial", told)
    monkeypatch.chdir(tmp_path)
    _colony(tmp_path)
    lines = [line.words for line in LINES if line.page.endswith("howto.md") and line.words.startswith("wakewise scan")]
    for words in lines:
        if "--resume" not in words and "my_package" not in words:
            assert run(shlex.split(words)[1:]) == 2
    assert len(folders) >= 6
    assert len(set(folders)) == len(folders)
