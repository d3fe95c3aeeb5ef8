"""`wakewise vehicle trim`: from a flight to the ballast of the next, for a known weight, and what is refused."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import wakewise as ww
from wakewise.operation import load_scenario, write_scenario
from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]
TWIST = ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")


def flown(folder: Path, weight_N: float, seconds: float = 8.0, **changes: object) -> Path:
    """A trial's folder with the record of a level hover that lacked this weight, 10 cm forward."""
    folder.mkdir()
    write_scenario(folder / "scenario.yaml", ww.Scenario.preset("quick", world="tank", **changes), {})
    rows = round(50 * seconds)
    level = {f"{who}_{name}": 0.0 for who in ("est", "goal") for name in TWIST}
    level |= {"est_qw": 1.0, "est_qx": 0.0, "est_qy": 0.0, "est_qz": 0.0}
    load = {"load_X_N": 0.0, "load_Y_N": 0.0, "load_Z_N": weight_N}
    load |= {"load_K_Nm": 0.0, "load_M_Nm": -0.1 * weight_N, "load_N_Nm": 0.0}
    columns = level | load | {f"command_{i + 1}_N": 0.0 for i in range(8)}
    frame = {"time_s": np.arange(rows) / 50.0, **{name: np.full(rows, value) for name, value in columns.items()}}
    pl.DataFrame(frame).write_parquet(folder / "steps.parquet")
    return folder


def refusal(capsys: Capsys, *words: str) -> str:
    assert run(["vehicle", "trim", *words]) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err.count("\n") == 1
    return shown.err


def test_a_flight_gives_the_ballast_of_the_next(tmp_path: Path, capsys: Capsys) -> None:
    """Words, a file with what was on the vehicle already and the new block, and a scenario that reads it."""
    folder, new = flown(tmp_path / "a", 3.0, ballast=[{"float_N": -1.4}]), tmp_path / "next.yaml"
    assert run(["vehicle", "trim", "--flight", str(folder), "--write", str(new)]) == 0
    shown = capsys.readouterr().out
    # 3 N that were found at 10 cm, and 1.4 N of lead that were known in the middle; rounded to the light side.
    assert "add 4.5 N of float 5 cm forward of the middle" in shown and str(new) in shown
    later = load_scenario("quick", new, {})
    assert [block.float_N for block in later.ballast] == [-1.4, 4.5]
    advised = shlex.split(shown.rpartition("fly with it: ")[2])
    assert advised == ["wakewise", "scan", str(new), "--out", "runs/a-trimmed"]
    assert run(["vehicle", "trim", "--flight", str(folder), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["net_weight_N"] == pytest.approx(4.4, abs=0.01)
    assert told["ballast"] == [block.model_dump(mode="json") for block in later.ballast]


def test_a_flight_by_hand_is_flown_again_in_the_cockpit(tmp_path: Path, capsys: Capsys) -> None:
    """A scan would refuse its pilot, who is nobody's record."""
    words = ["--flight", str(flown(tmp_path / "a", 3.0, pilot="operator")), "--write", str(tmp_path / "next.yaml")]
    assert run(["vehicle", "trim", *words]) == 0
    assert "fly with it: wakewise cockpit " in capsys.readouterr().out


def test_what_is_written_flies_as_the_flight_did_but_trimmed(tmp_path: Path, capsys: Capsys) -> None:
    """Target, vehicle, world, seed and all else are the flight's; a file that exists stays unless --force is given."""
    changes = {"target.kind": "plate", "vehicle": "bluerov2-heavy", "seed": 7, "tank.mismatch.trim_N": 3.0}
    folder, new = flown(tmp_path / "a flight", 3.0, **changes), tmp_path / "its next.yaml"
    words = ["--flight", str(folder), "--write", str(new)]
    assert run(["vehicle", "trim", *words]) == 0
    shown = capsys.readouterr().out
    advised = shlex.split(shown.rpartition("fly with it: ")[2])
    later, before = load_scenario("quick", Path(advised[2]), {}), load_scenario(None, folder / "scenario.yaml", {})
    assert later.model_copy(update={"ballast": ()}) == before and later.ballast
    assert "exists" in refusal(capsys, *words)
    assert run(["vehicle", "trim", *words, "--force"]) == 0


def test_a_vehicle_in_trim_is_left_alone(tmp_path: Path, capsys: Capsys) -> None:
    """No block, and the ballast of the next flight is that of the last."""
    folder, new = flown(tmp_path / "a", -0.1), tmp_path / "next.yaml"
    assert run(["vehicle", "trim", "--flight", str(folder), "--write", str(new)]) == 0
    assert "no change" in capsys.readouterr().out
    assert load_scenario("quick", new, {}).ballast == ()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--flight", "nowhere"), "not the folder of a trial"),
        (("paper", "--flight", "nowhere"), "VEHICLE does not go with it"),
        (("--flight", "nowhere", "--net-weight", "2"), "--net-weight does not go with it"),
        (("--write", "next.yaml"), "--flight"),
        (("--net-weight", "nan"), "net_weight_N"),
        (("--net-weight", "2", "--known-to", "-1"), "unknown_N"),
    ],
)
def test_what_does_not_go_together_is_one_line(capsys: Capsys, words: tuple[str, ...], said: str) -> None:
    """Exit 2 and what would be right."""
    assert said in refusal(capsys, *words)


def test_a_flight_without_a_hover_is_one_line(tmp_path: Path, capsys: Capsys) -> None:
    """Too short; or a record that cannot be read."""
    assert "of hover" in refusal(capsys, "--flight", str(flown(tmp_path / "a", 3.0, seconds=4.5)))
    broken = flown(tmp_path / "b", 3.0)
    (broken / "steps.parquet").write_bytes(b"no table")
    assert "cannot be read" in refusal(capsys, "--flight", str(broken))


@pytest.mark.slow
def test_a_weight_that_is_known_asks_for_floats(capsys: Capsys) -> None:
    """4 N heavy: floats, by effort, at no more speed at the target."""
    assert run(["vehicle", "trim", "--net-weight", "4", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["net_buoyancy_N"] == pytest.approx(-4.0, abs=0.01) and told["unknown_trim_N"] == 0.5
    assert told["advice"].startswith("add floats of") and told["best"]["thrust_N"] < told["now"]["thrust_N"]


def test_the_advice_names_figures_that_stand_in_the_table(capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its thrusts are those of the cells marked now and advised; no two rows have one name, and no zero has a sign."""
    monkeypatch.setenv("COLUMNS", "200")
    assert run(["vehicle", "trim", "bluerov2-heavy"]) == 0
    shown = capsys.readouterr().out
    speeds, thrusts, *_ = re.split(r"^(?=.*(?:thrust to hold|of it down))", shown, flags=re.MULTILINE)
    found = re.search(r"([\d.]+) to ([\d.]+) N of thrust.*, ([\d.]+) to ([\d.]+) mm/s", shown)
    assert found is not None
    for table, now, advised in ((thrusts, found[1], found[2]), (speeds, found[3], found[4])):
        assert float(re.findall(r"now: ([\d.]+)", table)[0]) == pytest.approx(float(now), abs=0.06)
        assert float(re.findall(r"advised: ([\d.]+)", table)[0]) == pytest.approx(float(advised), abs=0.06)
        rows = re.findall(r"^\S\s+([+-]\d+\.\d+)\s", table, flags=re.MULTILINE)
        assert len(rows) == len(set(rows)) > 4
    assert not re.search(r"-0\.0+\b", shown)
