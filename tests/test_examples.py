"""The examples: a question each, in one look, and what they say is what they do."""

import ast
import contextlib
import io
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SECONDS = "3"
"""Of flight: some of the hover before the first leg, by which a flight is judged that has no more."""
FLOWN = r"seed 1: water at the target \d+\.\d\d mm/s, \d+\.\d mm off its way, \d+\.\d{3} kJ, \d+ s"


def run(name, folder, *arguments):
    """What the example prints, run as the main program in an empty folder; kernels stay loaded for the next one."""
    out = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out):
        patch.chdir(folder)
        patch.setenv("MPLBACKEND", "Agg")
        patch.setattr(sys, "argv", [str(EXAMPLES / name), *arguments])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
    return out.getvalue()


def run_alone(name, folder, *arguments):
    """What the example prints in a process of its own, as for a reader."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def is_picture(path):
    return path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and path.stat().st_size > 10_000


def test_there_are_eleven():
    """Eleven questions."""
    assert len(list(EXAMPLES.glob("*.py"))) == 11


def test_types_of_the_examples_are_checked():
    """Mypy looks at the examples and at the cookbook, strictly, each time that it looks at the package."""
    settings = tomllib.loads((EXAMPLES.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    assert settings["strict"] and {"src", "examples", "tests/cookbook/reef_parts.py"} <= set(settings["files"])


@pytest.mark.slow
def test_the_examples_and_the_cookbook_pass_mypy():
    """`mypy --strict` has nothing to say of them: parts, figures and functions have the types that they claim."""
    looked = [sys.executable, "-m", "mypy", "--strict", "examples", "tests/cookbook/reef_parts.py"]
    done = subprocess.run(looked, cwd=EXAMPLES.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_wake_is_drawn_and_its_speeds_are_those_of_the_disturbance(tmp_path):
    """The picture is there; squares of the velocity, weighted, add up to D."""
    import wakewise as ww

    run("wake_field.py", tmp_path)
    assert is_picture(tmp_path / "wake_field.png")
    parts = ww.Scenario.preset("quick", vehicle="bluerov2-heavy").parts()
    pose, thrusts = [-0.6, 0.0, 1.3, 0.0, 0.1, 0.6], np.array([3.0, -2.0, -4.0, 1.0, 0.5, -1.0, 2.0, 0.0])
    water = ww.velocity(parts.vehicle, thrusts, pose, parts.region.points_W_m)
    D = float(parts.region.weights @ (water**2).sum(axis=1))
    assert pytest.approx(D, rel=1e-9) == ww.disturbance(parts.vehicle, thrusts, pose, parts.region)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_is_read_in_one_look(path):
    """At most 25 lines in all, and the first is the question as a docstring of one line."""
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 25
    question = ast.get_docstring(ast.parse(text)) or ""
    assert text.splitlines()[0] == f'"""{question}"""' and question.endswith("?")


def test_an_own_controller_flies_beside_ours(tmp_path):
    """One line for each, by name."""
    ours, mine = run("own_controller.py", tmp_path, SECONDS).splitlines()
    assert re.match(f"wake-aware, {FLOWN}", ours) and re.match(f"mine, {FLOWN}", mine)


def test_an_own_vehicle_says_what_it_can_do_and_flies(tmp_path):
    """Rank and null space are those of the geometry, of a file as of a name."""
    said = run("own_vehicle.py", tmp_path, "bluerov2-heavy", SECONDS)
    assert "8 thrusters, rank 6 of 6, 2 thrusts to spare" in said and said.count("null space ") == 2
    assert re.search(f"wake-aware, {FLOWN}", said)


def test_the_gentle_thrusts_of_one_wrench_are_gentler_and_drawn(tmp_path):
    """The speed at the target falls by more than half; the picture is there."""
    speeds = [float(mm_s) for mm_s in re.findall(r"([\d.]+) mm/s", run("one_wrench.py", tmp_path))]
    assert len(speeds) == 2 and speeds[1] < 0.5 * speeds[0]
    assert is_picture(tmp_path / "one_wrench.png")


@pytest.mark.slow
def test_ballast_is_advised_and_tried_in_the_tank(tmp_path):
    """Advice by the wake model, then two flights; less thrust to hold is less energy."""
    advice, before, after = run("ballast.py", tmp_path, "paper", SECONDS).splitlines()
    assert "12 poses held: add floats of" in advice
    assert before.startswith("as it is: dp") and after.startswith("as advised: dp")
    energies = [float(kJ) for line in (before, after) for kJ in re.findall(r"([\d.]+) kJ", line)]
    assert energies[1] < energies[0]


@pytest.mark.slow
def test_many_vehicles_at_once_say_which_stiffness_is_best(tmp_path):
    """Too soft is carried off by the current, too stiff follows the noise; the best lies between."""
    median_mm = [float(mm) for mm in re.findall(r"(\d+) mm off", run("many_vehicles.py", tmp_path))]
    assert len(median_mm) == 4
    assert median_mm[0] > median_mm[1] > median_mm[2] < median_mm[3]


@pytest.mark.slow
def test_a_learned_policy_flies_beside_dp_in_both_worlds(tmp_path):
    """A generation of training and two tanks: a line for each policy in each world."""
    rows = run("learned_policy.py", tmp_path, "1", "2").splitlines()
    assert [row.split(":")[0] for row in rows] == [
        f"{world}, {name}" for world in ("jet model", "tank") for name in ("dp", "learned")
    ]
    assert all(re.search(r"return -\d+\.\d\d, water \d+\.\d\d mm/s, \d+\.\d mm off, \d+\.\d J$", row) for row in rows)


def test_wake_models_are_ranked_by_the_lattice(tmp_path):
    """Both jets, every model; the printed cone of the paper is far off, a fitted one near."""
    from wakewise.wake.models import OWN_MODELS

    said = run("which_wake_model.py", tmp_path)
    rows = [line.split() for line in said.splitlines()]
    assert [row[0] for row in rows if row[0] in OWN_MODELS] == 2 * list(OWN_MODELS)
    by_name = {row[0]: [float(r2) for r2 in row[1:]] for row in rows if row[0] in OWN_MODELS}
    assert by_name["paper"][0] < -100 and min(by_name["fitted"]) > 0.5


def test_wake_models_are_ranked_by_measured_velocities(tmp_path):
    """A CSV file of velocities that `jet` made: `jet` explains all of them."""
    import wakewise as ww

    x, r = (grid.ravel() for grid in np.meshgrid(np.linspace(0.1, 0.5, 20), np.linspace(0.0, 0.1, 10)))
    speeds = ww.wake_model("jet").speed(x, r, 1.0, 0.25 * np.pi * 0.06**2)
    table = np.column_stack([x, r, np.ones(len(x)), speeds, np.full(len(x), 0.06)])
    np.savetxt(tmp_path / "jet.csv", table, delimiter=",", header="x_m,r_m,thrust_N,u_m_s,disk_diameter_m", comments="")
    said = run("which_wake_model.py", tmp_path, "jet.csv")
    assert re.search(r"^jet +1\.00 +1\.00$", said, re.MULTILINE)


@pytest.mark.slow
def test_photographs_become_a_model_in_metres(tmp_path):
    """Photographs with camera centres: all of them register and the model has a scale; a folder is all it takes."""
    import wakewise as ww
    from wakewise_paper.photo_sets import planned_views, write_photos

    mission = {"mission.elevations_deg": [45], "mission.views": [12], "mission.standoff_m": 0.4}
    scenario = ww.Scenario.preset("quick", **mission, **{"imaging.width": 320, "imaging.height": 240})
    target = scenario.parts().target
    views = planned_views(target, scenario.mission, scenario.imaging.exposure_s, np.random.default_rng(1))
    write_photos(tmp_path, views, None, scenario.imaging, target)
    said = run_alone("photographs_to_model.py", tmp_path, "images", "poses.csv")
    figures = ast.literal_eval(said)
    assert figures["images"] == figures["registered_images"] == 12 and figures["scale"] > 0.0
    assert (tmp_path / "runs" / "photographs" / "model" / "dense.ply").exists()


@pytest.mark.slow
def test_a_sweep_over_standoff_is_drawn(tmp_path):
    """A line for each method and standoff; farther off the water is stiller."""
    rows = run("standoff_sweep.py", tmp_path, SECONDS, "0.5", "0.9").splitlines()
    assert [row.split(",")[0] for row in rows] == ["0.5 m: dp", "0.9 m: dp", "0.5 m: wake-aware", "0.9 m: wake-aware"]
    near, far = (float(re.findall(r"([\d.]+) mm/s", row)[0]) for row in rows[:2])
    assert 0.0 < far < near
    assert is_picture(tmp_path / "standoff_sweep.png")


@pytest.mark.slow
def test_an_own_target_is_flown_round(tmp_path):
    """A mesh made in the script stands on the bed and is flown round by both methods."""
    first, *flights = run("own_target.py", tmp_path, SECONDS).splitlines()
    assert first.startswith("vase: ")
    assert re.match(f"dp, {FLOWN}", flights[0]) and re.match(f"wake-aware, {FLOWN}", flights[1])
