"""A folder of trials as a data set: read back by other means than it was written, and never half there."""

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import trimesh
from croissant_rules import complaints
from made_trials import POSE, make_trial, target_mesh

from wakewise.core.errors import InputError
from wakewise.experiments.exports.records import ros_body
from wakewise.experiments.trials.dataset import build_dataset, check_dataset, read_words
from wakewise.experiments.trials.dataset.statement import DatasetStatement
from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]
WORDS = ["--license", "CC-BY-4.0", "--creator", "Reef Lab", "--date", "2026-11-23"]


def words(**more: Any) -> DatasetStatement:
    return read_words(
        **{"name": "reef", "licence": "cc by 4.0", "creators": ["Reef Lab"], "published": "2026-11-23"} | more
    )


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """Two simulated trials and one that was not flown to its end, as a campaign keeps them."""
    folder = tmp_path / "campaign"
    make_trial(folder / "trials" / "0a1b", seed=1)
    make_trial(folder / "trials" / "2c3d", seed=2, thrusters=4, photographs=3)
    (folder / "trials" / "cut").mkdir()
    (folder / "trials" / "cut" / "scenario.yaml").write_text("name: quick\n")
    return folder


def _by_hand(folder: Path) -> dict[str, Any]:
    """The metadata, and every record of every table by its own words: globs, columns, types."""
    told = json.loads((folder / "croissant.json").read_text())
    files = {one["@id"]: one for one in told["distribution"]}
    tables = {}
    kinds = {"sc:Float": pl.Float64, "sc:Integer": pl.Int64, "sc:Boolean": pl.Boolean, "sc:Text": pl.String}
    for records in told["recordSet"]:
        where = next(v["@id"] for k, v in records["field"][0]["source"].items() if k.startswith("file"))
        one = files[where]
        paths = sorted(folder.glob(one["includes"])) if "includes" in one else [folder / one["contentUrl"]]
        schema = {f["source"]["extract"]["column"]: kinds[f["dataType"]] for f in records["field"]}
        read = [pl.read_parquet(path) for path in paths]
        table = pl.concat(read, how="diagonal")
        assert set(table.columns) == set(schema), records["@id"]
        for column, kind in schema.items():
            assert table.schema[column] == kind, (records["@id"], column)
        keys = [key["@id"].split("/")[1] for key in records["key"]]
        assert table.select(keys).n_unique() == table.height, records["@id"]
        tables[records["@id"]] = table
    return {"told": told, "tables": tables}


def test_a_campaign_is_read_back_by_its_metadata_alone(campaign: Path, tmp_path: Path) -> None:
    """Croissant names every table, column and type; values are those of the trials."""
    built = build_dataset(campaign, tmp_path / "reef", words())
    assert (built.trials, built.made, built.photographs) == (2, 2, 5)
    assert built.left_out == {"cut": "was not flown to its end"}
    read = _by_hand(built.path)
    assert list(complaints(read["told"])) == []
    assert read["told"]["license"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    tables = read["tables"]
    assert sorted(tables) == ["figures", "known-images", "known-states", "trials", "true-images", "true-states"]
    steps = pl.read_parquet(campaign / "trials" / "2c3d" / "steps.parquet")
    for name, starts in (("known-states", "est_"), ("true-states", "true_")):
        mine = tables[name].filter(pl.col("trial") == "2c3d").sort("time_s")
        columns = [f"{starts}{what}" for what in POSE]
        np.testing.assert_array_equal(mine.select(columns).to_numpy(), steps.select(columns).to_numpy())
    figures = dict(tables["figures"].select("trial", "rmse_mm").iter_rows())
    assert figures == {"0a1b": 1.5, "2c3d": 2.5}
    trials = {row["trial"]: row for row in tables["trials"].to_dicts()}
    assert trials["2c3d"]["target"] == "coral.ply"
    assert trials["0a1b"]["method"] == "dp"
    assert trials["0a1b"]["duration_s"] == pytest.approx(0.1)


def test_what_a_controller_could_not_know_is_under_truth_alone(campaign: Path, tmp_path: Path) -> None:
    """No column of known/ tells of the truth, not even one that nobody thought of; it stands without truth/."""
    folder = build_dataset(campaign, tmp_path / "reef", words()).path
    shutil.rmtree(folder / "truth")
    for path in folder.rglob("*.parquet"):
        for column in pl.read_parquet(path).columns:
            assert not re.match(r"true_|thrust_|target_speed|power|new_secret|collision|turbidity", column), path
    for path in folder.rglob("*"):
        if path.is_file() and path.name not in {"croissant.json", "SHA256SUMS", "DATASHEET.md"}:
            assert path.name not in {"target.ply", "camera.json", "scenario.yaml", "metrics.json"}
    states = pl.read_parquet(folder / "known" / "0a1b" / "states.parquet")
    assert {"est_x_m", "goal_x_m", "command_1_N", "wrench_X_N", "load_X_N", "disturbance", "exposing"} <= set(
        states.columns
    )


def test_photographs_and_surfaces_are_the_same_bytes_and_places(campaign: Path, tmp_path: Path) -> None:
    """Photographs byte by byte; the mesh as trimesh reads it is the target, in the world's frame."""
    folder = build_dataset(campaign, tmp_path / "reef", words()).path
    for name in ("000.png", "002.png"):
        taken = (campaign / "trials" / "2c3d" / "images" / name).read_bytes()
        assert (folder / "known" / "2c3d" / "images" / name).read_bytes() == taken
    mesh = trimesh.load(folder / "truth" / "2c3d" / "target.ply", process=False)
    np.testing.assert_allclose(mesh.vertices, target_mesh().vertices_m, atol=1e-6)
    assert "/home" not in (folder / "truth" / "2c3d" / "scenario.yaml").read_text()
    assert "kind: coral.ply" in (folder / "truth" / "2c3d" / "scenario.yaml").read_text()


def test_poses_lead_to_ros_and_back(campaign: Path, tmp_path: Path) -> None:
    """What the sheet says of frames: turned into ENU/FLU by REP 103's own words, written anew, and back, to 1e-12."""
    folder = build_dataset(campaign, tmp_path / "reef", words()).path
    states = pl.read_parquet(folder / "truth" / "0a1b" / "states.parquet")
    p, q = (states.select(f"true_{what}" for what in part).to_numpy() for part in (POSE[:3], POSE[3:]))
    w, x, y, z = q.T
    R_WB = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    forward, left, up = R_WB[:, :, 0], -R_WB[:, :, 1], -R_WB[:, :, 2]
    p_enu, q_enu = ros_body(p, q)
    np.testing.assert_allclose(p_enu, np.column_stack([p[:, 1], p[:, 0], -p[:, 2]]), atol=1e-12)
    w, x, y, z = q_enu.T
    first = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    np.testing.assert_allclose(first, np.column_stack([forward[:, 1], forward[:, 0], -forward[:, 2]]), atol=1e-12)
    third = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    np.testing.assert_allclose(third, np.column_stack([up[:, 1], up[:, 0], -up[:, 2]]), atol=1e-12)
    assert np.all(np.cross(up, forward) @ left[0] > 0.0)
    back, turned = ros_body(p_enu, q_enu)
    np.testing.assert_allclose(back, p, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(turned * q, axis=1)), 1.0, atol=1e-12)


def test_check_sums_are_what_sha256sum_and_hashlib_say(campaign: Path, tmp_path: Path) -> None:
    """SHA256SUMS has every file, its own sum is in croissant.json, and that file's in croissant.json.sha256."""
    folder = build_dataset(campaign, tmp_path / "reef", words()).path
    sums = dict(reversed(line.split("  ", 1)) for line in (folder / "SHA256SUMS").read_text().splitlines())
    here = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert set(sums) == here - {"SHA256SUMS", "croissant.json", "croissant.json.sha256"}
    for name, digest in sums.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    if shutil.which("sha256sum"):
        for listed in ("SHA256SUMS", "croissant.json.sha256"):
            subprocess.run(["sha256sum", "--quiet", "-c", listed], cwd=folder, check=True)
    assert check_dataset(folder).differences == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: (d / "known/0a1b/images/000.png").write_bytes(b"x"), "known/0a1b/images/000.png changed"),
        (lambda d: (d / "truth/0a1b/target.ply").unlink(), "truth/0a1b/target.ply missing"),
        (lambda d: (d / "known/more.txt").write_text("x"), "known/more.txt not in the list"),
        (lambda d: (d / "SHA256SUMS").write_text(""), "SHA256SUMS changed"),
        (lambda d: (d / "croissant.json").write_text("{}"), "is no Croissant metadata"),
        (lambda d: (d / "croissant.json").unlink(), "is no data set"),
        (lambda d: _one_byte(d / "croissant.json", b"sc:Dataset", b"sc:dataset"), "croissant.json changed"),
        (lambda d: (d / "croissant.json.sha256").unlink(), "croissant.json.sha256 missing or empty"),
        (lambda d: (d / "croissant.json.sha256").write_bytes(b"\xff\xfe"), "line 1 is no check sum"),
    ],
)
def test_whatever_is_changed_is_noticed(campaign: Path, tmp_path: Path, change: Any, said: str, capsys: Capsys) -> None:
    """One line says which file, exit code 2."""
    folder = build_dataset(campaign, tmp_path / "reef", words()).path
    change(folder)
    assert run(["export", str(folder), "--to", "dataset", "--check"]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert said in last


def _one_byte(path: Path, old: bytes, new: bytes) -> None:
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new, 1))


def test_a_list_that_leads_elsewhere_is_refused(campaign: Path, tmp_path: Path) -> None:
    """A path of somebody else's making never leads out of the folder."""
    folder = build_dataset(campaign, tmp_path / "reef", words()).path
    (folder / "SHA256SUMS").write_text(f"{'0' * 64}  ../../etc/passwd\n")
    told = json.loads((folder / "croissant.json").read_text())
    told["distribution"][0]["sha256"] = hashlib.sha256((folder / "SHA256SUMS").read_bytes()).hexdigest()
    (folder / "croissant.json").write_text(json.dumps(told))
    with pytest.raises(InputError, match="lies outside"):
        check_dataset(folder)


def test_it_goes_on_where_it_was_cut_off(campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed after the first trial, or while it is laid out: nothing is there yet; then only what is left is done."""
    from wakewise.experiments.trials.dataset import build

    out = tmp_path / "reef"

    def killed(done: int, total: int, note: str = "") -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_dataset(campaign, out, words(), killed)
    assert not out.exists()
    with monkeypatch.context() as patch:
        patch.setattr(build, "metadata", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            build_dataset(campaign, out, words())
    assert not out.exists()
    moved: list[Path] = []
    real = Path.replace

    def moves(self: Path, to: Path) -> Path:
        if ".parts" in self.parts and self.name in ("known", "truth"):
            if moved:
                raise KeyboardInterrupt
            moved.append(self)
        return real(self, to)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", moves)
        with pytest.raises(KeyboardInterrupt):
            build_dataset(campaign, out, words())
    assert not out.exists()
    built = build_dataset(campaign, out, words())
    assert (built.trials, built.made) == (2, 1)
    assert check_dataset(out).differences == ()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["campaign", "reef"]
    assert not list(out.rglob(".*"))


def test_a_trial_that_changed_meanwhile_is_taken_anew(campaign: Path, tmp_path: Path) -> None:
    """What was taken before is of a flight that is no more; a trial that went away goes."""
    with pytest.raises(KeyboardInterrupt):
        build_dataset(campaign, tmp_path / "reef", words(), lambda done, *_: _stop(done == 2))
    shutil.rmtree(campaign / "trials" / "0a1b")
    shutil.rmtree(campaign / "trials" / "2c3d")
    make_trial(campaign / "trials" / "2c3d", seed=7)
    built = build_dataset(campaign, tmp_path / "reef", words())
    assert (built.trials, built.made) == (1, 1)
    assert pl.read_parquet(built.path / "trials.parquet")["seed"].to_list() == [7]
    assert sorted(path.name for path in (built.path / "known").iterdir()) == ["2c3d"]


def _stop(now: bool) -> None:
    if now:
        raise KeyboardInterrupt


def test_trials_that_cannot_be_taken_are_left_out_and_said(campaign: Path, tmp_path: Path) -> None:
    """A photograph that went away, a table that is none, half a mesh: the sheet says why, the others are taken."""
    (campaign / "trials" / "0a1b" / "images" / "001.png").unlink()
    for name, file in (("half", "truth.ply"), ("table", "steps.parquet"), ("figures", "metrics.json")):
        path = make_trial(campaign / "trials" / name, seed=5) / file
        path.write_bytes(path.read_bytes()[:20])
    built = build_dataset(campaign, tmp_path / "reef", words())
    assert built.trials == 1
    assert sorted(built.left_out) == ["0a1b", "cut", "figures", "half", "table"]
    sheet = (built.path / "DATASHEET.md").read_text()
    assert "- 0a1b: images/001.png: listed in images.csv but not there" in sheet
    assert str(campaign) not in sheet
    shutil.rmtree(campaign / "trials" / "2c3d")
    with pytest.raises(InputError, match="none of 5 trials can be taken"):
        build_dataset(campaign, tmp_path / "again", words())
    assert not (tmp_path / "again").exists()


def test_one_trial_and_a_real_vehicles_are_data_sets_too(tmp_path: Path) -> None:
    """Of a real vehicle there is no truth, and none is claimed; a trial's own folder is enough."""
    trial = make_trial(tmp_path / "dive 7", real=True)
    built = build_dataset(trial, tmp_path / "out", words(licence="https://example.org/licence"))
    read = _by_hand(built.path)
    assert sorted(read["tables"]) == ["known-images", "known-states", "trials"]
    assert list(complaints(read["told"])) == []
    assert not read["tables"]["trials"]["simulated"].item()
    assert read["told"]["license"] == "https://example.org/licence"
    sheet = (built.path / "DATASHEET.md").read_text()
    assert "By a real vehicle; there is no truth" in sheet
    assert "Simulated water" not in sheet


def test_a_campaigns_own_folder_is_read_as_campaigns_leave_it(tmp_path: Path) -> None:
    """Flights alone and whole trials in work/, settings and figures beside; what is not finished is left out."""
    campaign = tmp_path / "campaign"
    for key, work in (("aa", "work"), ("bb", "work/trial"), ("cc", "work")):
        folder = make_trial(campaign / "trials" / key / work, seed=3)
        scenario = {"name": "quick", "seed": 3, "method": "dp", "target": {"kind": "/home/somebody/plate.ply"}}
        told = {"name": key, "work": "x:y", "settings": {"scenario": scenario, "keep": "all"}, "key": key}
        (campaign / "trials" / key / "trial.json").write_text(json.dumps(told))
        if key != "cc":
            figures = {"figures": {"energy_kJ": 2.0, "fallbacks": None, "mapping": "poses"}, "took_s": 1.0}
            (campaign / "trials" / key / "figures.json").write_text(json.dumps(figures))
        if work == "work":
            for name in ("scenario.yaml", "metrics.json", "images.csv", "truth.ply", "camera.json", "cameras.txt"):
                (folder / name).unlink()
    built = build_dataset(campaign, tmp_path / "reef", words())
    assert built.left_out == {"cc": "was not flown to its end"}
    read = _by_hand(built.path)
    assert list(complaints(read["told"])) == []
    rows = {row["trial"]: row for row in read["tables"]["trials"].to_dicts()}
    assert (rows["aa"]["method"], rows["aa"]["target"], rows["aa"]["photographs"]) == ("dp", "plate.ply", 0)
    assert rows["bb"]["photographs"] == 2
    figures = {row["trial"]: row for row in read["tables"]["figures"].to_dicts()}
    assert (figures["aa"]["energy_kJ"], figures["bb"]["rmse_mm"]) == (2.0, 3.5)
    assert "/home" not in (built.path / "truth" / "aa" / "scenario.yaml").read_text()


def test_the_sheet_has_every_section_and_its_makers_answers(campaign: Path, tmp_path: Path) -> None:
    """Seven sections of Gebru et al., facts that were counted, answers as given, and what is open said as open."""
    (tmp_path / "answers.yaml").write_text("purpose: To learn wakes {and} more.\nethics: |\n  none\n  needed\n")
    told = words(answers=tmp_path / "answers.yaml")
    sheet = (build_dataset(campaign, tmp_path / "reef", told).path / "DATASHEET.md").read_text()
    for section in (
        "Motivation",
        "Composition",
        "Collection process",
        "Preprocessing",
        "Uses",
        "Distribution",
        "Maintenance",
    ):
        assert f"\n## {section}" in sheet
    assert "To learn wakes {and} more." in sheet
    assert "none needed" in sheet
    assert sheet.count("For its makers to say") == 4  # funding, period, maintenance, and where it will be
    assert "| photographs | 5 |" in sheet
    assert "| methods | dp (1), wake-aware (1) |" in sheet
    assert "2 of 2 trials were flown in Wakewise's simulated tank" in sheet
    assert max(len(line) for line in sheet.splitlines() if not line.startswith("|")) <= 200


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "--license: missing"),
        (["--license", "mine", "--creator", "A"], "CC-BY-4.0"),
        (["--license", "MIT"], "--creator: missing"),
        ([*WORDS, "--url", "reef"], "https://"),
        ([*WORDS, "--version", "1"], "MAJOR.MINOR.PATCH"),
        ([*WORDS, "--date", "yesterday"], "YYYY-MM-DD"),
        ([*WORDS, "--answers", "none.yaml"], "--answers none.yaml"),
        ([*WORDS, "--answers", "odd.yaml"], "'price' is not asked"),
        ([*WORDS, "--out", "campaign/trials/new"], "lies among the trials"),
        ([*WORDS, "--out", "full"], "not empty"),
        ([*WORDS, "--vehicle", "paper"], "no vehicle"),
        ([*WORDS, "--poses", "estimated"], "no --origin, --poses or --frame"),
        ([*WORDS, "--check"], "no other option"),
    ],
)
def test_bad_words_are_one_line(
    more: list[str], said: str, campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    """Exit code 2, and nothing is written."""
    monkeypatch.chdir(campaign.parent)
    Path("odd.yaml").write_text("price: 1\n")
    Path("full").mkdir()
    Path("full/thesis.txt").write_text("dear")
    before = sorted(Path().rglob("*"))
    assert run(["export", "campaign", "--to", "dataset", *more]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert said in shown.err
    assert len(shown.err.strip().splitlines()) == 1
    assert sorted(Path().rglob("*")) == before


def test_a_folder_without_trials_is_refused(tmp_path: Path) -> None:
    """Nothing there, nothing flown, or nothing at all."""
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no trial"):
        build_dataset(tmp_path / "empty", tmp_path / "out", words())
    with pytest.raises(InputError, match="no such folder"):
        build_dataset(tmp_path / "nowhere", tmp_path / "out", words())


def test_the_command_says_what_it_did(campaign: Path, tmp_path: Path, capsys: Capsys) -> None:
    """As JSON, and to people; below the campaign's export/ where no place is given, and never over an old one."""
    assert run(["export", str(campaign), "--to", "dataset", *WORDS, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["trials"], told["photographs"]) == (2, 5)
    assert told["path"] == str(campaign / "export" / "dataset")
    assert told["files"] == sum(path.is_file() for path in Path(told["path"]).rglob("*"))
    assert told["bytes"] == sum(path.stat().st_size for path in Path(told["path"]).rglob("*") if path.is_file())
    assert run(["export", str(campaign), "--to", "dataset", *WORDS]) == 2
    assert "there already" in capsys.readouterr().err
    assert run(["export", told["path"], "--to", "dataset", "--check", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["differences"] == {}
    assert run(["export", str(campaign), "--to", "dataset", *WORDS, "--out", str(tmp_path / "b")]) == 0
    out = capsys.readouterr().out
    assert "2 trials, 5 photographs" in out
    assert "left out        cut: was not flown to its end" in out
