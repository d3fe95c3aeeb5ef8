"""`wakewise wake fit` and `wake validate`: figures on standard output, one line for bad input."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from wakewise.ui.cli.main import run
from wakewise.wake.models import WakeSettings, wake_model


@pytest.fixture
def data(tmp_path):
    """A CSV of 300 points at three thrusts, made by a known jet with a little noise."""
    rng = np.random.default_rng(0)
    distance, angle = rng.uniform(0.1, 0.5, 300), rng.uniform(0.0, 0.5, 300)
    thrust = np.repeat([1.0, 2.0, 4.0], 100)
    x, r = distance * np.cos(angle), distance * np.sin(angle)
    model = wake_model(
        WakeSettings(model="fitted", gain=0.5, decay_power=1.0, cosine_power=40.0, soft_radius_m=0.05, floor=False)
    )
    speed = model.speed(x, r, thrust, 0.25 * np.pi * 0.06**2) + 0.005 * rng.standard_normal(300)
    path = tmp_path / "jet.csv"
    rows = [f"{a},{b},{t},{u}" for a, b, t, u in zip(x, r, thrust, speed, strict=True)]
    path.write_text("x_m,r_m,thrust_N,u_m_s\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_fit_prints_parameters_with_uncertainty_and_writes_a_model(data, tmp_path, capsys):
    """One JSON object with value, error and interval of each number; the file is settings of that model."""
    out = tmp_path / "wake.yaml"
    code = run(
        ["wake", "fit", str(data), "--disk-diameter-m", "0.06", "--out", str(out), "--bootstrap", "20", "--json"]
    )
    assert code == 0
    result = json.loads(capsys.readouterr().out)
    power = result["parameters"]["cosine_power"]
    assert abs(power["value"] - 40.0) < 4.0 * power["standard_error"]
    assert power["low"] < power["value"] < power["high"]
    assert result["test"]["r2_wake"] > 0.95
    assert not set(result["train_thrusts_N"]) & set(result["test_thrusts_N"])
    written = yaml.safe_load(out.read_text(encoding="utf-8"))["control"]["wake"]
    assert WakeSettings.model_validate(written).cosine_power == pytest.approx(power["value"], rel=1e-4)


def test_fit_shows_a_table_to_people(data, capsys):
    """Without --json there are a table, the split and every warning in words."""
    assert run(["wake", "fit", str(data), "--disk-diameter-m", "0.06", "--model", "jet", "--bootstrap", "0"]) == 0
    text = capsys.readouterr().out
    assert "half_width_slope" in text
    assert "held out" in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "diameter is not known"),
        (["--disk-diameter-m", "0"], "disk_diameter_m 0"),
        (["--disk-diameter-m", "0.06", "--model", "paper"], "no free parameters"),
        (["--disk-diameter-m", "0.06", "--test-thrust", "3"], "held out"),
    ],
)
def test_bad_input_is_one_line_and_code_two(data, capsys, options, words):
    """What is wrong and what is allowed, on standard error."""
    assert run(["wake", "fit", str(data), *options]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert words in said.err
    assert said.err.count("\n") == 1


def test_vectors_that_are_nan_are_counted_and_a_place_that_is_nan_is_refused(data, tmp_path, capsys):
    """A velocity that nobody measured leaves its row out, which is said; a place that is no number is a fault."""
    whole = data.read_text(encoding="utf-8")
    data.write_text(whole + "0.1,0.0,1.0,nan\n0.1,0.0,1.0,\n", encoding="utf-8")
    out = tmp_path / "wake.yaml"
    words = ["wake", "fit", str(data), "--disk-diameter-m", "0.06", "--bootstrap", "0"]
    assert run([*words, "--out", str(out)]) == 0
    assert "warning: 2 vectors NaN or empty left out" in capsys.readouterr().out
    assert "2 vectors NaN or empty left out" in out.read_text(encoding="utf-8")
    data.write_text(whole + "nan,0.0,1.0,0.5\n", encoding="utf-8")
    assert run(words) == 2
    assert "line 302: x_m is nan" in capsys.readouterr().err


@pytest.mark.parametrize(("unit", "newtons"), [("kgf", 9.80665), ("lbf", 4.448), ("g", 9.80665e-3)])
@pytest.mark.parametrize("model", ["fitted", "jet"])
def test_a_thrust_in_another_unit_is_refused_by_the_law_of_momentum(data, tmp_path, capsys, unit, newtons, model):
    """Whatever model is fitted: no file is written, and the line says how far the flux is off the thrust."""
    head, *rows = data.read_text(encoding="utf-8").splitlines()
    parted = [row.split(",") for row in rows]
    text = "\n".join([head, *(f"{x},{r},{float(t) / newtons},{u}" for x, r, t, u in parted)])
    data.write_text(text + "\n", encoding="utf-8")
    out = tmp_path / "wake.yaml"
    words = ["wake", "fit", str(data), "--disk-diameter-m", "0.06", "--model", model, "--bootstrap", "0"]
    assert run([*words, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "units?" in said
    assert said.count("\n") == 1
    assert not out.exists()
    # The same numbers, with the unit in the column's name.
    if unit != "g":
        data.write_text(text.replace("thrust_N", f"thrust_{unit}") + "\n", encoding="utf-8")
        assert run([*words, "--json"]) == 0
        law = json.loads(capsys.readouterr().out)["momentum_flux_over_thrust"]
        assert law["measured"] == pytest.approx(1.04, abs=0.05)


def test_a_flux_that_is_unlikely_is_marked(data, tmp_path, capsys):
    """Speeds half as large again: fitted, and marked on the screen and in the file."""
    head, *rows = data.read_text(encoding="utf-8").splitlines()
    parted = [row.split(",") for row in rows]
    data.write_text("\n".join([head, *(f"{x},{r},{t},{1.5 * float(u)}" for x, r, t, u in parted)]), encoding="utf-8")
    out = tmp_path / "wake.yaml"
    words = ["wake", "fit", str(data), "--disk-diameter-m", "0.06", "--bootstrap", "0", "--out", str(out)]
    assert run(words) == 0
    told = capsys.readouterr().out
    assert "momentum flux over thrust: 2.43 by the points" in told
    assert "units? a jet in water has 0.5 to 1.3" in told
    assert "units?" in out.read_text(encoding="utf-8")


@pytest.mark.slow
def test_validate_prints_the_demanded_keys_and_writes_a_page(tmp_path, capsys):
    """models, grid_convergence_pct and paper are there; the page needs no network."""
    out = tmp_path / "report"
    assert run(["wake", "validate", "--quick", "--data", str(tmp_path / "none"), "--out", str(out), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["paper"] == {"r2_core": 0.99, "r2_wake": 0.82}
    assert "grid_convergence_pct" in values
    assert set(values["models"]["fitted"]["parcels"]) >= {"r2_core", "r2_wake", "bias_far_pct"}
    page = (out / "wake.html").read_text(encoding="utf-8")
    assert "Where the printed formula fails" in page
    assert "http://" not in page
    assert "https://" not in page
    assert json.loads((out / "wake.json").read_text(encoding="utf-8")) == values
