"""`wakewise campaign`: a file becomes trials, tables and reasons; work here is cheap, nothing is flown."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from wakewise.experiments.campaigns import definition, task
from wakewise.experiments.campaigns.definition import keep_campaign
from wakewise.experiments.campaigns.store import open_store
from wakewise.ui.cli.main import run as command

FILE = "name: small\nstages: fly\nmethods: [dp, mpc]\ntargets: [branching, brain]\nseeds: 2\n"


@pytest.fixture
def cheap_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Has flights replaced by a module beside the campaign's file."""
    (tmp_path / "pretend.py").write_text(
        "import time\n"
        "def fly(settings, folder, progress):\n"
        "    scenario = settings['scenario']\n"
        "    time.sleep(0.02)\n"
        "    if scenario['method'] == 'mpc' and scenario['seed'] == 2:\n"
        "        raise ValueError('no way')\n"
        "    return {'target_speed_mean_m_s': 0.01 * scenario['seed'], 'success': True, 'energy_kJ': None}\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(definition._WORK, "fly", "pretend:fly")
    monkeypatch.setattr("wakewise.core.jit.precompile.compile_kernels", lambda *_, **__: None)
    (tmp_path / "small.yaml").write_text(FILE)
    return tmp_path


def _json(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


def test_a_campaign_is_run_looked_at_and_gone_on_with(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Status counts, the table has means with intervals and the failures' reasons; a second run makes nothing."""
    assert command(["campaign", "run", "small.yaml", "--workers", "2", "--json"]) == 0
    told = _json(capsys)
    assert (told["trials"], told["done"], told["failed"], told["waiting"]) == (8, 6, 2, 0)
    assert {one["reason"] for one in told["failures"]} == {"ValueError: no way"}
    groups = {(group["method"], group["target"]): group for group in told["groups"]}
    speed = groups["dp", "branching"]["figures"]["target_speed_mean_m_s"]
    assert (speed["mean"], speed["n"]) == (pytest.approx(0.015), 2)
    assert speed["low"] <= 0.015 <= speed["high"]
    success = groups["mpc", "brain"]["figures"]["success"]
    assert (success["mean"], success["n"]) == (0.5, 2)  # one failed, which is no success
    assert groups["dp", "brain"]["figures"]["energy_kJ"]["why"] == "no trial gave it"

    assert command(["campaign", "run", "small.yaml", "--json"]) == 0
    assert _json(capsys)["attempts"] == 8
    assert command(["campaign", "status", "runs/small", "--json"]) == 0
    assert _json(capsys)["done"] == 6
    assert command(["campaign", "table", "small.yaml", "--by", "method", "--write", "all.parquet", "--json"]) == 0
    by_method = _json(capsys)["groups"]
    assert [group["trials"] for group in by_method] == [4, 4]
    table = pl.read_parquet("all.parquet")
    assert table.height == 8
    assert set(table["state"]) == {"done", "failed"}


def test_trials_that_the_computer_failed_are_told_and_made_by_the_same_command(
    cheap_work: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 1 and a line: they count as waiting, not as failed, and need no --again."""
    (cheap_work / "pretend.py").write_text(
        "from pathlib import Path\n"
        "def fly(settings, folder, progress):\n"
        "    if settings['scenario']['seed'] == 2 and not Path('room').exists():\n"
        "        raise MemoryError('Unable to allocate 9 GiB')\n"
        "    return {'success': True}\n"
    )
    assert command(["campaign", "run", "small.yaml", "--workers", "2", "--retries", "0", "--json"]) == 1
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert (told["done"], told["failed"], told["waiting"]) == (4, 0, 4)
    assert err.strip().splitlines()[-1] == (
        "wakewise: runs/small: 4 of 8 trials could not be made, the first: dp/branching/payload/2: out of memory "
        "(Unable to allocate 9 GiB); what was finished is kept, run the same command again to go on"
    )
    Path("room").touch()
    assert command(["campaign", "run", "small.yaml", "--workers", "2", "--json"]) == 0
    assert _json(capsys)["done"] == 8


def test_no_cell_of_a_csv_is_a_formula(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Names that spreadsheets would run have an apostrophe before them there; Parquet keeps them as they are."""
    names = ("=cmd|' /C calc'!A0", "+1", "-1", "@sum", "as it is")
    told = ", ".join(f'"{name}": {{}}' for name in names)
    Path("small.yaml").write_text(f"{FILE}variations: {{{told}}}\n")
    campaign = definition.load_campaign(Path("small.yaml"))
    open_store(Path("runs/small"))
    keep_campaign(Path("runs/small"), campaign, definition.planned_trials(campaign))
    for suffix in ("csv", "parquet"):
        assert command(["campaign", "table", "small.yaml", "--write", f"all.{suffix}", "--json"]) == 0
    capsys.readouterr()
    assert set(pl.read_csv("all.csv")["variation"]) == {*(f"'{name}" for name in names[:4]), "as it is"}
    assert set(pl.read_parquet("all.parquet")["variation"]) == set(names)


def test_a_name_that_leaves_its_folder_makes_nothing(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 in a line, and no folder anywhere."""
    Path("small.yaml").write_text(FILE.replace("name: small", "name: ../../evil"))
    before = {path.name for path in cheap_work.parent.iterdir()}
    for words in (["campaign", "run", "small.yaml"], ["campaign", "status", "small.yaml"]):
        assert command(words) == 2
        assert "small.yaml: name: found '../../evil', names a folder" in capsys.readouterr().err
    assert not Path("runs").exists()
    assert {path.name for path in cheap_work.parent.iterdir()} == before


def test_people_see_tables_and_reasons(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same in words."""
    assert command(["campaign", "run", "small.yaml"]) == 0
    shown = capsys.readouterr().out
    assert "6 of 8 trials" in shown
    assert "ValueError: no way" in shown
    assert command(["campaign", "status", "runs/small"]) == 0
    assert "small: 6 of 8 trials done, 0 at work, 0 waiting, 2 failed" in capsys.readouterr().out


def test_one_hover_is_told_in_the_singular(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A trial is no trials, and a flight that ended before its first leg is said to be a hover."""
    text = (cheap_work / "pretend.py").read_text().replace("'success': True", "'hover_only': 1.0")
    (cheap_work / "pretend.py").write_text(text)
    (cheap_work / "one.yaml").write_text("name: one\nstages: fly\nmethods: [dp]\nseeds: 1\nduration_s: 2\n")
    assert command(["campaign", "run", "one.yaml"]) == 0
    shown = capsys.readouterr().out
    assert "1 of 1 trial; mean" in shown
    assert "Hover only: the flight ended before the first leg (duration_s)." in shown
    assert command(["campaign", "status", "runs/one"]) == 0
    assert "1 of 1 trial done" in capsys.readouterr().out


def test_a_page_says_who_won(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In the folder that is asked for; what is no factor is refused before anything is written."""
    assert command(["campaign", "run", "small.yaml", "--workers", "2", "--json"]) == 0
    capsys.readouterr()
    assert command(["campaign", "page", "small.yaml", "--out", "there", "--json"]) == 0
    told = _json(capsys)
    assert Path(told["page"]).read_text(encoding="utf-8").count("<h1>") == 1
    assert {one["figure"] for one in told["glances"]} == {"success", "target_speed_mean_m_s"}
    assert command(["campaign", "page", "small.yaml", "--compare", "seed", "--out", "else"]) == 2
    assert "allowed: method" in capsys.readouterr().err and not Path("else").exists()


def test_more_seeds_are_made_beside_those_that_are_there(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Extending a campaign makes what is new; taking something out of it leaves its trials in the folder."""
    assert command(["campaign", "run", "small.yaml"]) == 0
    Path("small.yaml").write_text(FILE.replace("seeds: 2", "seeds: [1, 2, 3]").replace("dp, ", ""))
    capsys.readouterr()
    assert command(["campaign", "run", "small.yaml", "--json"]) == 0
    told = _json(capsys)
    assert (told["trials"], told["attempts"], told["others"]) == (6, 6, 4)


def test_a_folder_of_another_version_is_refused(
    cheap_work: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a line, with what to do; it can still be looked at."""
    assert command(["campaign", "run", "small.yaml"]) == 0
    plan = Path("runs/small/plan.json")
    plan.write_text(plan.read_text().replace(json.loads(plan.read_text())["sources"], "0" * 64))
    capsys.readouterr()
    assert command(["campaign", "run", "small.yaml"]) == 2
    said = capsys.readouterr().err
    assert "holds trials of another version" in said
    assert "give another --out" in said
    assert command(["campaign", "status", "runs/small", "--json"]) == 0
    assert _json(capsys)["done"] == 6


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "none.yaml"], "none.yaml: cannot be read"),
        (["run", "small.yaml", "--engine", "dsk"], "did you mean dask? allowed: processes, dask"),
        (["run", "small.yaml", "--scheduler", "tcp://127.0.0.1:1"], "--scheduler: only with --engine dask"),
        (["run", "small.yaml", "--workers", "0"], "workers: 0, allowed 1 to"),
        (["run", "small.yaml", "--timeout", "0"], "timeout: 0 s, must be more than 0"),
        (["run", "small.yaml", "--out", "pretend.py"], "is a file, must be a folder or not exist"),
        (["status", "nowhere"], "nowhere: no campaign is there"),
        (["table", "nowhere"], "nowhere: no campaign is there"),
    ],
)
def test_bad_input_is_a_line_and_exit_code_2(
    cheap_work: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    """And nothing is begun."""
    assert command(["campaign", *words]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert not Path("runs").exists()


def test_a_group_or_figure_that_is_not_there_is_refused(cheap_work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With those that are."""
    assert command(["campaign", "run", "small.yaml"]) == 0
    assert command(["campaign", "table", "runs/small", "--by", "colour"]) == 2
    assert "allowed: method, target" in capsys.readouterr().err
    assert command(["campaign", "table", "runs/small", "--figures", "speed"]) == 2
    assert "allowed: target_speed_mean_m_s" in capsys.readouterr().err
    assert command(["campaign", "table", "runs/small", "--write", "x.xls"]) == 2
    assert "must end in .parquet or .csv" in capsys.readouterr().err


def test_ctrl_c_ends_with_130_and_the_same_command_goes_on(cheap_work: Path) -> None:
    """Nothing that was finished is lost, and no worker stays behind."""
    (cheap_work / "pretend.py").write_text(
        "import time\nfrom pathlib import Path\n"
        "def fly(settings, folder, progress):\n"
        "    while settings['scenario']['seed'] > 1 and not Path('go').exists():\n"
        "        time.sleep(0.02)\n"
        "    return {'success': True}\n"
    )
    script = (
        "import sys; from wakewise.experiments.campaigns import definition; from wakewise.core.jit import precompile\n"
        "definition._WORK['fly'] = 'pretend:fly'; precompile.compile_kernels = lambda *_, **__: None\n"
        "from wakewise.ui.cli.main import main; main()"
    )
    (cheap_work / "small.yaml").write_text(FILE.replace("branching, brain", "plate").replace("seeds: 2", "seeds: 3"))
    words = ["campaign", "run", "small.yaml", "--workers", "2"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    first = subprocess.Popen([sys.executable, "-c", script, *words], env=environment, stderr=subprocess.PIPE, text=True)
    while not list(Path("runs").glob("small/trials/*/figures.json")):
        assert first.poll() is None
        time.sleep(0.02)
    first.send_signal(signal.SIGINT)
    assert "run the same command again to go on" in first.communicate()[1]
    assert first.returncode == 130
    kept = {path: path.stat().st_mtime_ns for path in Path("runs").glob("small/trials/*/figures.json")}
    assert 0 < len(kept) <= 2
    assert not list(Path("runs").glob("small/.drivers/*"))
    Path("go").touch()
    assert command(words) == 0
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in kept.items())
    assert len(list(Path("runs").glob("small/trials/*/figures.json"))) == 6


def test_the_example_is_printed_alone(capsys: pytest.CaptureFixture[str]) -> None:
    """So that it can be sent into a file."""
    assert command(["campaign", "example"]) == 0
    assert capsys.readouterr().out == definition.example()


def test_sources_are_known() -> None:
    """Parts of the package that a trial names are there."""
    for stage in ("fly", "model"):
        assert len(task.source_version(definition._SOURCES[stage])) == 64
