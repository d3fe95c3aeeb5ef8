"""`wakewise vehicle thruster` and `wakewise vehicle lag`: figures for machines and people, faults in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.vehicle_thruster import lag, thruster

app = typer.Typer(pretty_exceptions_enable=False)
app.command("thruster")(thruster)
app.command("lag")(lag)


def run(*arguments: str) -> None:
    app(args=list(arguments), standalone_mode=False)


def test_a_curve_is_shown_to_machines(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """One JSON object with limits, deadband and look-ups both ways; the drawing is an SVG."""
    drawing = tmp_path / "t200.svg"
    run("thruster", "t200", "--supply-V", "16", "--thrust", "-10", "--pwm", "1700", "--plot", str(drawing), "--json")
    facts = json.loads(capsys.readouterr().out)
    assert facts["limits_N"] == [-39.91, 51.44]
    assert facts["deadband_us"] == [1472.0, 1528.0]
    assert facts["thrusts"][0]["thrust_N"] == pytest.approx(-10.0)
    assert facts["pulses"][0]["pwm_us"] == 1700.0
    assert drawing.read_text().startswith("<svg")


def test_a_curve_is_shown_to_people(capsys: pytest.CaptureFixture[str]) -> None:
    run("thruster", "--thrust", "51.44")
    shown = capsys.readouterr().out
    assert "t200 at 16 V (table: 10, 12, 14, 16, 20 V)" in shown
    assert "no thrust from 1472 to 1528 us" in shown
    assert "51.44" in shown
    assert "Blue Robotics" in shown


def test_a_table_of_ones_own_shows_what_was_found_in_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    table = tmp_path / "mine.csv"
    table.write_text("supply_V,pwm_us,thrust_N\n12,1100,-20\n12,1500,0\n12,1900,30\n")
    run("thruster", str(table))
    shown = capsys.readouterr().out
    assert "mine at 12 V" in shown
    assert "note: 12 V, forward: no row between 1500 us" in shown
    assert "—" in shown


def test_a_lag_is_found_in_a_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The time constant that made the file comes back, to machines and to people."""
    time = np.arange(0.0, 3.0, 0.01)
    late = np.maximum(time - 1.05, 0.0)
    thrust = 8.0 * (1.0 - np.exp(-late / 0.2)) + np.random.default_rng(0).normal(0.0, 0.05, time.size)
    path = tmp_path / "step.csv"
    rows = "".join(f"{t:.2f},{int(t >= 0.999)},{f:.5f}\n" for t, f in zip(time, thrust, strict=True))
    path.write_text("time_s,command,thrust_N\n" + rows)
    run("lag", str(path), "--json")
    facts = json.loads(capsys.readouterr().out)
    assert facts["model"] == "first order"
    assert facts["time_constant_s"] == pytest.approx(0.2, rel=0.05)
    assert facts["delay_s"] == pytest.approx(0.05, abs=0.01)
    assert facts["estimates"]["time_constant_s"]["standard_error"] < 0.02
    assert facts["r2"] > 0.99
    run("lag", str(path), "--average-s", "0.05")
    shown = capsys.readouterr().out
    assert "first order, after dead time" in shown
    assert "against averages over 0.05 s" in shown


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["thruster", "t500"], "not in the library"),
        (["thruster", "nowhere.csv"], "no such file"),
        (["thruster", "--supply-V", "42"], "the table holds 10 to 20 V"),
        (["thruster", "--thrust", "nan"], "must be finite"),
        (["thruster", "--thrust", "500"], "desired thrust: 500 N, t200 at 16 V gives -39.91 to 51.44 N"),
        (["thruster", "--thrust", "5", "--thrust", "-40"], "desired thrust: -40 N"),
        (["thruster", "--thrust", "inf"], "desired thrust: inf N"),
        (["thruster", "--pwm", "2500"], "pulse: 2500 us, t200 at 16 V gives 1100 to 1900 us"),
        (["lag", "nowhere.csv"], "no such file"),
    ],
)
def test_faults_are_told_in_one_line(arguments: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        run(*arguments)
    assert "\n" not in str(caught.value)
