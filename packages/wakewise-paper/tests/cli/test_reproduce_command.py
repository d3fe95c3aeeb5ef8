"""`wakewise reproduce` on the command line; the trials themselves are stood in for."""

import json
import re

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.task import TrialOutcome
from wakewise.ui.cli.main import run
from wakewise_paper.cli.reproduce import seconds


@pytest.fixture
def made(monkeypatch, tmp_path):
    """Every trial becomes the same figures, but for the method's own wash; runs in an empty folder."""
    from wakewise_paper.reproduction import run as module

    def campaign(tasks, folder, engine, **options):
        rivals = {"wakewise_paper.dp_paper:make_dp_paper": 0.025, "weighted-pseudo-inverse": 0.01}
        wash = rivals | {
            "manual": 0.03,
            "manual-careful": 0.028,
            "dp": 0.02,
            "mpc": 0.02,
            "mpc-smooth": 0.018,
            "wake-aware": 0.005,
        }
        fields = [task.settings["scenario"] for task in tasks]
        return [
            TrialOutcome(
                task=task,
                figures={
                    "target_speed_mean_m_s": wash[own["method"]] + 1e-4 * own["seed"],
                    "position_rmse_mm": 2.0, "estimate_rmse_mm": 5.0, "energy_kJ": 1.0, "roll_pitch_rms_deg": 1.0,
                    "roll_pitch_max_deg": 2.0,
                },
                attempts=1,
                took_s=1.0,
            )
            for task, own in zip(tasks, fields, strict=True)
        ]  # fmt: skip

    monkeypatch.setattr(module, "run_campaign", campaign)
    monkeypatch.setattr(module, "compile_kernels", lambda **_: None)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_json_is_one_object_with_the_promised_keys(made, capsys):
    """And nothing else on standard output; a table not met is no fault."""
    assert run(["reproduce", "station", "--trials", "6", "--world", "pump-tank", "--first-seed", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told)[:4] == ["rows", "trials", "seeds", "config_hash"]
    assert told["trials"] == 6 and told["seeds"] == [1, 2, 3, 4, 5, 6] and "places" not in told
    rows = {(row["method"], row["figure"]): row for row in told["rows"]}
    assert all(
        list(row)[:9] == ["method", "target", "figure", "paper", "ours", "low", "high", "n", "met"]
        for row in rows.values()
    )
    less = rows["wake-aware", "wash at the target, less than dp-paper"]
    assert (
        less["paper"] == 67.0
        and less["ours"] == pytest.approx(100.0 * (1.0 - 5.35 / 25.35), abs=0.1)
        and less["met"]
        and less["sure"]
    )
    assert (less["baseline"], less["source"]) == ("dp-paper", "section Gentle Stability")
    assert (less["setup"], less["met_by_all"], less["preliminary"]) == ("the paper's own", False, True)
    assert rows["wake-aware", "energy, less than dp-paper"]["met"] is False
    assert all(row["why"][key] for row in rows.values() for key in ("baseline", "source") if row[key] is None)


def test_people_get_a_table_and_a_page(made, capsys):
    """With paper, ours and verdict in words."""
    assert run(["reproduce", "station", "--world", "pump-tank", "--first-seed", "1"]) == 0
    said = capsys.readouterr().out
    words = " ".join(re.sub("[│┃]", " ", said).split())
    assert "less than dp-paper" in words and "page:" in words
    assert "figures met in the paper's own set-up, pump-tank" in words and "too few pairs" in words
    assert "0.203" in words and "79.7" not in words
    page = (made / "runs" / "reproduce" / "reproduce.html").read_text(encoding="utf-8")
    assert "The paper" in page and "station" in page
    assert json.loads((made / "runs" / "reproduce" / "results.json").read_text())["tables"]["station"]["rows"]


def test_markdown_pages_are_for_keeping_beside_the_code(made, capsys):
    """Small, without pictures of trials, with machine, versions and seeds."""
    words = ["--trials", "2", "--first-seed", "1", "--world", "pump-tank", "--markdown", "--out", "kept"]
    assert run(["reproduce", "station", *words]) == 0
    names = {path.name for path in (made / "kept").iterdir()}
    assert {"README.md", "station.md", "reproduced.md", "results.json", "station-methods.svg"} <= names
    assert sum(path.stat().st_size for path in (made / "kept").iterdir()) < 300_000
    index = (made / "kept" / "README.md").read_text(encoding="utf-8")
    assert "cores" in index and "numpy" in index and "1 to 2" in index
    why = (made / "kept" / "reproduced.md").read_text(encoding="utf-8")
    assert "## Met in the paper's own set-up, pump-tank" in why and str(made) not in index + why


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["quantum"], "'quantum'"),
        (["station", "--world", "atlantis"], "pump-tank"),
        (["station", "--methods", "magic"], "wake-aware"),
        (["dynamic", "--targets", "unicorn"], "brain"),
        (["station", "--budget", "soon"], "30min"),
        (["station", "--trials", "0"], "--trials"),
        (["station", "--methods", ","], "names"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_left(made, capsys, arguments, words):
    """What is wrong and what would be right."""
    assert run(["reproduce", *arguments]) == 2
    said = capsys.readouterr()
    assert words in said.err and said.out == ""
    assert list(made.iterdir()) == []


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("store.json", '{"format": 0}', "results of format 0, this Wakewise reads 1; give another folder"),
        ("results.json", '{"tables": {}}', "holds something that is no campaign; give another folder"),
    ],
)
def test_a_store_of_another_version_or_a_folder_of_results_is_refused_in_a_line(made, capsys, file, text, words):
    """Before anything is compiled or written."""
    (made / "old").mkdir()
    (made / "old" / file).write_text(text)
    assert run(["reproduce", "station", "--store", "old"]) == 2
    said = capsys.readouterr()
    (line,) = [line for line in said.err.splitlines() if "old" in line]
    assert words in line and said.out == ""
    assert [path.name for path in (made / "old").iterdir()] == [file]
    assert [path.name for path in made.iterdir()] == ["old"]


def test_times_are_read_as_people_write_them():
    """Minutes, hours, seconds; a number alone is seconds."""
    assert [seconds("--budget", text) for text in ("30min", "2h", "90s", "1.5 h", "45")] == [1800, 7200, 90, 5400, 45]
    for text in ("", "-1min", "0h", "1 week"):
        with pytest.raises(InputError, match="--budget"):
            seconds("--budget", text)
