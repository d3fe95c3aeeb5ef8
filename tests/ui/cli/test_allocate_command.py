"""`wakewise allocate`: what it prints can be checked from the formula alone, and bad input is one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from wakewise.robot.vehicles import load_vehicle
from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]
PAPER = load_vehicle("paper")
WRENCH = np.array([2.0, -1.0, -3.0, 0.05, 0.1, 0.2])
POSE = ("0", "0", "0.6", "0", "0.1", "0.2")
TABLE = "x_m,y_m,z_m,weight\n0.1,0.1,1.0,1\n0.2,0.05,1.1,0.5\n0.15,-0.15,1.2,2\n-0.1,-0.1,1.1,1\n"


@pytest.fixture
def points(tmp_path: Path) -> Path:
    path = tmp_path / "p.csv"
    path.write_text(TABLE)
    return path


def words(points: Path, *more: str) -> list[str]:
    return [
        *("allocate", "--vehicle", "paper", "--pose", *POSE),
        *("--wrench", *(str(x) for x in WRENCH), "--points", str(points), *more),
    ]


def answer(capsys: Capsys, points: Path, *more: str) -> dict[str, object]:
    assert run(words(points, *more, "--json")) == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def printed_disturbance(thrusts: np.ndarray, coherent: bool) -> float:
    """D from the paper's cone as printed: v = sqrt(|T| / (2 pi rho A)) (1 m / r)^2 cos^4 within 45 deg."""
    roll, pitch, yaw = 0.0, 0.1, 0.2
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    R = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    rows = np.array([[float(x) for x in line.split(",")] for line in TABLE.splitlines()[1:]])
    total = 0.0
    for *place, weight in rows:
        speeds = []
        for thruster, T in zip(PAPER.thrusters, thrusts, strict=True):
            jet = -np.sign(T) * (R @ thruster.axis_B)
            away = np.array(place) - (np.array([0.0, 0.0, 0.6]) + R @ thruster.p_BT_m)
            r = np.linalg.norm(away)
            cosine = away @ jet / r
            exit_speed = np.sqrt(abs(T) / (2.0 * np.pi * 998.0 * thruster.disk_area_m2))
            speeds.append(exit_speed / r**2 * cosine**4 * jet if cosine >= np.cos(np.pi / 4) else np.zeros(3))
        v = np.array(speeds)
        total += weight * (np.sum(v.sum(0) ** 2) if coherent else np.sum(v**2))
    return float(total)


@pytest.mark.parametrize("sum_", ["coherent", "incoherent"])
def test_d_is_the_printed_formula_and_the_wrench_is_made(capsys: Capsys, points: Path, sum_: str) -> None:
    """Evaluated point by point from the formula, D before and after is what the command says."""
    found = answer(capsys, points, "--wake-model", "paper", "--sum", sum_)
    after, before = np.array(found["thrusts_N"]), np.array(found["thrusts_pinv_N"])
    assert set(found) >= {"wrench_error_rel", "method", "gap", "null_space"}
    np.testing.assert_allclose(PAPER.allocation_matrix @ after, WRENCH, atol=1e-9)
    np.testing.assert_allclose(PAPER.allocation_matrix @ before, WRENCH, atol=1e-9)
    assert found["wrench_error_rel"] <= 1e-9
    assert found["disturbance"] == pytest.approx(printed_disturbance(after, sum_ == "coherent"), rel=1e-9)
    assert found["disturbance_pinv"] == pytest.approx(printed_disturbance(before, sum_ == "coherent"), rel=1e-9)
    assert found["disturbance"] < found["disturbance_pinv"]
    assert found["gap"] <= 1e-5
    null = np.array(found["null_space"])
    np.testing.assert_allclose(PAPER.allocation_matrix @ null.T, 0.0, atol=1e-12)


def test_no_thrusts_of_a_coarse_grid_cost_less(capsys: Capsys, points: Path) -> None:
    """A grid over both null vectors, evaluated from the formula, finds nothing below the answer."""
    found = answer(capsys, points, "--wake-model", "paper")
    T, null = np.array(found["thrusts_N"]), np.array(found["null_space"])

    def cost(thrusts: np.ndarray) -> float:
        """With the weights of a flight: 150 times the mean square speed (weights add up to 4.5), 1e-3 a newton^2."""
        return 150.0 / 4.5 * printed_disturbance(thrusts, True) + 1e-3 * float(thrusts @ thrusts)

    ours = cost(T)
    for a in np.linspace(-6.0, 6.0, 13):
        for b in np.linspace(-6.0, 6.0, 13):
            other = T + a * null[0] + b * null[1]
            assert ours <= cost(other) * (1.0 + 1e-4)


def test_a_failed_thruster_rests_and_what_is_lost_is_said(capsys: Capsys, points: Path) -> None:
    """By number or by name; two front horizontals gone leave five axes, and the rest is named."""
    found = answer(capsys, points, "--failed", "1", "--failed", PAPER.thrusters[1].name)
    assert found["thrusts_N"][:2] == [0.0, 0.0]
    assert found["rank"] == 5 and found["given_up"] and found["wrench_error_rel"] > 1e-3
    assert run(words(points, "--failed", "1", "--failed", "2")) == 0
    shown = capsys.readouterr().out
    assert "(failed)" in shown and "given up" in shown


def test_the_previous_thrusts_pull(capsys: Capsys, points: Path) -> None:
    """With a heavy weight on change the answer comes closer to the thrusts before."""
    before = np.array(answer(capsys, points)["thrusts_N"]) + np.array([1.0, 1, 1, 1, 0, 0, 0, 0])
    text = ",".join(str(x) for x in before)
    free = np.array(answer(capsys, points)["thrusts_N"])
    held = np.array(answer(capsys, points, "--previous", text, "--w-previous", "100")["thrusts_N"])
    assert np.linalg.norm(held - before) < np.linalg.norm(free - before)


def test_people_see_both_allocations(capsys: Capsys, points: Path) -> None:
    """The table has every thruster, D before and after, method and gap."""
    assert run(words(points, "--wake-model", "paper")) == 0
    shown = capsys.readouterr().out
    assert all(t.name in shown for t in PAPER.thrusters)
    assert "% less" in shown and "lines, gap" in shown


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--vehicle", "submarine"], "submarine"),
        (["--wake-model", "storm"], "unknown, allowed"),
        (["--sum", "both"], "allowed: coherent, incoherent"),
        (["--failed", "9"], "no such thruster"),
        (["--failed", "0"], "no such thruster"),
        (["--previous", "1,2"], "2 numbers, allowed: 8"),
        (["--previous", "1,2,x"], "not numbers"),
        (["--priority", "QX"], "unknown"),
        (["--w-effort", "-1"], "must be finite and more than 0"),
        (["--w-effort", "0"], "must be finite and more than 0"),
        (["--w-disturbance", "-1"], "must be finite and at least 0"),
        (["--pose", "0", "0", "0.6", "0", "90", "0"], "radians"),
        (["--pose", "0", "0", "nan", "0", "0", "0"], "finite"),
        (["--wrench", "1", "1", "1", "1", "1", "inf"], "finite"),
        (["--wrench", "1", "1", "1"], "wrench"),
        (["--pose", "0.1", "0.1", "1.0", "0", "0", "0"], "inside the vehicle"),
    ],
)
def test_bad_options_are_one_line(capsys: Capsys, points: Path, more: list[str], said: str) -> None:
    """Exit code 2, nothing on standard output, one line that says what was wrong."""
    assert run(words(points, *more)) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err.count("\n") == 1
    assert said in shown.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "columns none"),
        ("x_m,y_m,z_m\n0,0,1\n", "columns x_m, y_m, z_m, lacks weight, allowed"),
        ("x_m,y_m,z_m,weight\n", "holds no points"),
        ("x_m,y_m,z_m,weight\n0,0,1,-1\n", "line 2 has weight -1"),
        ("x_m,y_m,z_m,weight\n0,0,1,nan\n", "four finite numbers"),
        ("x_m,y_m,z_m,weight\n0,0,1\n", "four numbers"),
        ("x_m,y_m,z_m,weight\n0,0,one,1\n", "four numbers"),
        ("x_m,y_m,z_m,weight\n0,0,1.5,0\n", "all weights are 0"),
    ],
)
def test_bad_points_are_one_line(capsys: Capsys, tmp_path: Path, text: str, said: str) -> None:
    """Empty, short, negative, not a number: the line and the reason are named."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    assert run(words(path)) == 2
    assert said in capsys.readouterr().err
    assert run(words(tmp_path / "none.csv")) == 2


def test_a_target_that_no_jet_reaches_is_said_with_the_nearest_passage(capsys: Capsys, tmp_path: Path) -> None:
    """D is 0 both ways: the distance from a point to the nearest jet's axis, found by walking along it, is told."""
    path = tmp_path / "far.csv"
    path.write_text("x_m,y_m,z_m,weight\n0.2,3,0.1,1\n0,0,5,0\n")
    level = ("--pose", "0", "0", "0", "0", "0", "0", "--wrench", "10", "0", "0", "0", "0", "0")
    assert run(["allocate", "--vehicle", "paper", *level, "--points", str(path)]) == 0
    said = capsys.readouterr().out
    told = float(said.split("no jet of either reaches a point; the nearest passes ")[1].split(" m")[0])
    assert run(["allocate", "--vehicle", "paper", *level, "--points", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["disturbance"] == found["disturbance_pinv"] == 0.0
    nearest = np.inf
    for thrusts in (found["thrusts_N"], found["thrusts_pinv_N"]):
        for thruster, T in zip(PAPER.thrusters, thrusts, strict=True):
            if abs(T) > 1e-6:
                along = thruster.p_BT_m - np.sign(T) * np.linspace(0.0, 40.0, 40001)[:, None] * thruster.axis_B
                nearest = min(nearest, np.linalg.norm(along - [0.2, 3.0, 0.1], axis=1).min())
    assert told == pytest.approx(nearest, abs=0.006)


def test_a_wrench_of_nothing_spares_nothing(capsys: Capsys, points: Path) -> None:
    """Without a push there is no jet, and that is said; where jets meet the points nothing of the kind is."""
    assert run(["allocate", "--pose", *POSE, "--wrench", *["0"] * 6, "--points", str(points)]) == 0
    assert "no thruster pushes" in capsys.readouterr().out
    assert run(words(points)) == 0
    assert "reaches" not in capsys.readouterr().out
