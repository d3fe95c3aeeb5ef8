"""What cannot be flown is refused before anything flies: exit code 2, one line, no folder."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.operation import fly, load_scenario
from wakewise.operation.parts import surroundings_of
from wakewise.operation.worlds.makers import true_start
from wakewise.planning import Surroundings, check_start
from wakewise.ui.cli.main import run


def refused(capsys, *arguments):
    assert run(["scan", "--out", "result", *arguments]) == 2
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert captured.out == "" and len(lines) == 1, captured.err
    assert not Path("result").exists()
    return lines[0]


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (["control.w_disturbance=-1"], ["control.w_disturbance", "-1", "greater than or equal to 0"]),
        (["control.plan.w_track=.nan"], ["control.plan.w_track", "finite"]),
        (["control.plan.attitude_tolerance_rad=-0.5"], ["control.plan.attitude_tolerance_rad", "-0.5"]),
        (["control.obstacles=[[0.9, 0, 1.1, -0.2]]"], ["control.obstacles", "-0.2"]),
        (
            ["mission.standoff_m=0.05", "mission.elevations_deg=[80]", "mission.views=[12]"],
            ["mission.standoff_m", "the target"],
        ),
        (["control.obstacles=[[0.8, 0, 1.1, 0.3]]"], ["start", "obstacle 1", "control.obstacles"]),
        (["control.obstacles=[[-0.5, 0, 1.2, 0.1]]"], ["mission at", "obstacle 1", "control.obstacles"]),
        (["target.fragility_gain=-2"], ["target.fragility_gain", "-2"]),
    ],
)
def test_a_mission_that_cannot_be_flown_is_refused(sets, words, capsys, tmp_path, monkeypatch):
    """Weights, obstacles at the start or on the way, a target inside the hull: the line names field and limit."""
    monkeypatch.chdir(tmp_path)
    line = refused(capsys, *(word for one in sets for word in ("--set", one)))
    for word in words:
        assert word in line, line


def test_limits_with_min_above_max_are_refused(capsys, tmp_path, monkeypatch):
    """A vehicle file whose thruster pushes no less than -(-5) N backwards and 2 N at most is no vehicle."""
    from importlib import resources

    monkeypatch.chdir(tmp_path)
    text = (resources.files("wakewise.robot.vehicles") / "library_data" / "paper.yaml").read_text()
    assert "max_reverse_N" in text
    lines = [line.split(":")[0] + ": -5.0" if "max_reverse_N" in line else line for line in text.splitlines()]
    Path("odd.yaml").write_text("\n".join(lines))
    assert "max_reverse_N" in refused(capsys, "--vehicle", "odd.yaml")


def test_an_empty_target_is_refused(capsys, tmp_path, monkeypatch):
    """A mesh with vertices and no faces has no surface to spare."""
    monkeypatch.chdir(tmp_path)
    Path("none.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    assert "none.obj" in refused(capsys, "--target", "none.obj")


def test_the_planner_knows_the_tank_and_the_target():
    """Six faces of the tank, the target's sphere where the target stands, and the stated obstacles."""
    scenario = load_scenario(
        "quick", None, {"control.obstacles": [[2.0, 0.0, 1.0, 0.1]], "control.allocation.null_space": False}
    )
    parts = scenario.parts()
    table = parts.controller.motion.model.table
    assert table.planes.shape == (6, 4)
    assert table.spheres[0].tolist() == [2.0, 0.0, 1.0, 0.1]
    vertices = parts.surveyed_target.mesh.vertices_m
    inside = [np.linalg.norm(vertices - sphere[:3], axis=1) <= sphere[3] + 1e-9 for sphere in table.spheres[1:]]
    assert np.all(np.any(inside, axis=0))


def test_a_wide_target_is_covered_by_several_spheres():
    """Their radii stay near a sixth of a metre, so that the water beside a wide target is free."""
    scenario = load_scenario("quick", None, {})
    target = scenario.replace(**{"target.kind": "plate"}).parts().target
    one = surroundings_of(scenario, target).spheres
    assert len(one) >= 1 and one[:, 3].max() <= 0.2


def test_a_flight_from_a_bad_start_is_refused_whoever_planned_it():
    """A mission that was made by hand is checked, too."""
    scenario = load_scenario("quick", None, {})
    start = scenario.parts().start
    blocked = scenario.model_copy(
        update={"control": scenario.control.model_copy(update={"obstacles": ((*start.X_WB.p_m, 0.1),)})}
    )
    with pytest.raises(InputError, match=r"start: .*obstacle 1"):
        fly(blocked, duration_s=0.1)
    with pytest.raises(InputError, match=r"start: .*obstacle 1"):
        fly(blocked, duration_s=0.1, checked=False)


def test_names_are_numbers_where_there_are_none():
    """A surrounding without names still says which one it is."""
    around = Surroundings(planes=np.array([[0.0, 0.0, -1.0, -1.5]]), spheres=np.array([[0.0, 0.0, 1.0, 0.2]]))
    assert (around.name(0), around.name(1)) == ("plane 1", "sphere 1")
    scenario = load_scenario("quick", None, {})
    parts = scenario.parts()
    with pytest.raises(InputError, match="finite"):
        check_start(parts.vehicle, parts.region, np.full(13, np.nan), around)


def test_the_start_is_off_by_what_is_said():
    """2 cm and 0.03 rad per axis, standard deviation, over many draws; and a flight does begin off its start."""
    parts = load_scenario("quick", None, {"method": "dp"}).parts()
    desired = parts.start.X_WB
    kept = {name: getattr(parts, name) for name in ("vehicle", "target", "region", "route", "start")}
    found = [true_start(parts.replace(seed=seed, **kept)).X_WB for seed in range(600)]
    off_m = np.array([X.p_m - desired.p_m for X in found])
    turn = np.array([rotvec_from_quat(quat_multiply(quat_conjugate(desired.q), X.q)) for X in found])
    np.testing.assert_allclose(off_m.std(axis=0), 0.02, rtol=0.1)
    np.testing.assert_allclose(turn.std(axis=0), 0.03, rtol=0.1)
    np.testing.assert_allclose(off_m.mean(axis=0), 0.0, atol=0.003)
    off = np.linalg.norm(parts.world.tank().state.X_WB.p_m - desired.p_m)
    assert 0.002 < off < 0.1
