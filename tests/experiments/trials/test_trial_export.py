"""`wakewise export`: a trial's folder, made by hand, as files of other tools; what cannot be done is one line."""

import json
from pathlib import Path

import cv2
import numpy as np
import polars as pl
import pytest
import yaml

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_euler
from wakewise.experiments.exports import GeodeticOrigin
from wakewise.experiments.trials.export import EXPORTS, export_trial
from wakewise.ui.cli.main import run
from wakewise.vision.reconstruction import OrientedPointCloud, write_cloud

Capsys = pytest.CaptureFixture[str]
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    """Six steps, two of them with photographs of 8 x 6 px; estimates are 1 cm north of the truth."""
    folder = tmp_path / "trial"
    (folder / "images").mkdir(parents=True)
    steps: dict[str, object] = {"time_s": np.arange(6) * 0.02}
    for who, north in (("true", 0.0), ("est", 0.01), ("goal", 0.0)):
        turns = np.array([quat_from_euler(0.0, 0.0, 0.1 * k) for k in range(6)])
        places = np.column_stack([np.arange(6) * 0.1 + north, np.full(6, 0.5), np.full(6, 1.2)])
        columns = np.column_stack([places, turns]).T
        steps |= {f"{who}_{what}": column for what, column in zip(POSE, columns, strict=True)}
    steps |= {f"goal_{axis}_m_s": np.full(6, 0.1) for axis in "uvw"}
    steps |= {f"thrust_{k + 1}_N": np.full(6, float(k)) for k in range(3)}
    steps |= {f"wrench_{axis}": np.ones(6) for axis in ("X_N", "Y_N", "Z_N", "K_Nm", "M_Nm", "N_Nm")}
    steps["exposing"] = np.array([False, True, False, False, True, False])
    pl.DataFrame(steps).write_parquet(folder / "steps.parquet")
    lines = ["name,time_s," + ",".join(f"{who}_{what}" for who in ("est", "true") for what in POSE)]
    for k in range(2):
        cv2.imwrite(str(folder / "images" / f"{k:03}.png"), np.full((6, 8, 3), 40 * k, np.uint8))
        lines.append(f"{k:03}.png,{0.02 + 0.06 * k},0.11,0.5,1.2,1,0,0,0,0.1,0.5,1.2,1,0,0,0")
    (folder / "images.csv").write_text("\n".join(lines) + "\n")
    camera = {"width": 8, "height": 6, "fx": 9.0, "fy": 9.0, "cx": 4.0, "cy": 3.0, "k1": 0, "k2": 0, "p1": 0, "p2": 0}
    (folder / "camera.json").write_text(json.dumps(camera))
    (folder / "cameras.txt").write_text("1 OPENCV 8 6 9.5 9.5 4 3 0.01 0 0 0\n")
    return folder


def test_each_format_is_written_once_and_again(trial: Path) -> None:
    """Below export/, every format; a second time replaces the first, and nothing half-done stays behind."""
    pytest.importorskip("rosbags")
    for _ in range(2):
        for to in EXPORTS:
            origin = GeodeticOrigin(36.5, -6.3) if to == "qgc-plan" else None
            assert export_trial(trial, to, origin=origin).path.exists()
    assert sorted(path.name for path in (trial / "export").iterdir()) == [
        "colmap", "nerfstudio", "rosbag2", "route.plan", "tum",
    ]  # fmt: skip
    assert sorted(path.name for path in (trial / "export" / "rosbag2").iterdir()) == ["metadata.yaml", "rosbag2.mcap"]
    assert len(json.loads((trial / "export" / "route.plan").read_text())["mission"]["items"]) == 2
    told = yaml.safe_load((trial / "export" / "rosbag2" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    counts = {row["topic_metadata"]["name"]: row["message_count"] for row in told["topics_with_message_count"]}
    assert counts == {
        "/true/pose": 6, "/estimated/pose": 6, "/tf": 16, "/thrusts": 6, "/wrench": 6,
        "/camera/image/compressed": 2, "/camera/camera_info": 2,
    }  # fmt: skip


def test_an_export_for_trainers_lists_split_water_and_dense_points(trial: Path, tmp_path: Path, capsys: Capsys) -> None:
    """export.json: what is held out, the water of the trial's scenario, dense points; null with a reason otherwise."""
    assert run(["export", str(trial), "--to", "colmap", "--out", str(tmp_path / "bare"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    told = json.loads((tmp_path / "bare" / "export.json").read_text())
    assert (said["train"], said["held_out"], said["dense_points"]) == (1, 1, 0)
    assert told["water"]["attenuation_per_m"] is None
    assert "scenario.yaml" in told["water"]["why"]
    assert (told["dense"], "dense.ply" in told["why"]["dense"]) == (None, True)
    (trial / "scenario.yaml").write_text("imaging: {water_type: 3C}\n")
    points = np.random.default_rng(0).normal(size=(200, 3))
    write_cloud(trial / "dense.ply", OrientedPointCloud(points_m=points, normals=0 * points, colours=0 * points))
    words = [
        "export",
        str(trial),
        "--to",
        "nerfstudio",
        "--out",
        str(tmp_path / "full"),
        "--held-out",
        "2",
        "--seed",
        "5",
    ]
    assert run(words) == 0
    assert "water (trial): attenuation 1.16, 1.24, 1.51 /m in red, green, blue" in capsys.readouterr().out
    told = json.loads((tmp_path / "full" / "export.json").read_text())
    assert (told["dense"], told["dense_points"]) == ("dense_pc.ply", 200)
    assert told["water"]["attenuation_per_m"] == {"red": 1.16, "green": 1.235, "blue": 1.514}
    assert told["split"]["held_out"] == [one["name"] for one in told["views"] if one["held_out"]]
    flat = json.loads((tmp_path / "full" / told["undistorted"] / "transforms.json").read_text())
    assert [Path(path).name for path in flat["test_filenames"]] == told["split"]["held_out"]
    assert (flat["k1"], flat["k2"], flat["p1"], flat["p2"]) == (0.0, 0.0, 0.0, 0.0)
    for frame in flat["frames"]:
        assert (tmp_path / "full" / told["undistorted"] / frame["file_path"]).is_file()


def test_water_of_estimated_poses_is_fitted_or_said_to_be_unknown(trial: Path, tmp_path: Path) -> None:
    """Without a model there are no ranges to fit the water by; what the scenario says is not told of."""
    (trial / "scenario.yaml").write_text("imaging: {water_type: 3C}\n")
    done = export_trial(trial, "colmap", out=tmp_path / "out", poses="estimated")
    assert done.water is not None
    assert (done.water.source, done.water.attenuation_per_m) == (None, None)
    assert "no reconstruction" in str(done.water.why)


def test_estimated_poses_go_with_the_camera_as_the_crew_knows_it(trial: Path, tmp_path: Path) -> None:
    """True poses with camera.json, estimated ones with cameras.txt; world x is north."""
    for who, north, focal in (("true", 0.1, 9.0), ("estimated", 0.11, 9.5)):
        done = export_trial(trial, "nerfstudio", out=tmp_path / who, poses=who)
        told = json.loads((done.path / "transforms.json").read_text())
        assert told["fl_x"] == focal
        np.testing.assert_allclose(np.array(told["frames"][0]["transform_matrix"])[:3, 3], [north, -0.5, -1.2])


def test_a_flight_without_truth_exports_what_it_has(trial: Path, tmp_path: Path) -> None:
    """Of a real vehicle nobody knows the truth: estimates are exported, true photographs are refused with a way out."""
    steps = pl.read_parquet(trial / "steps.parquet")
    unknown = [name for name in steps.columns if name.startswith(("true_", "thrust_"))]
    steps.with_columns(pl.lit(float("nan")).alias(name) for name in unknown).write_parquet(trial / "steps.parquet")
    table = pl.read_csv(trial / "images.csv", schema_overrides={"name": pl.String})
    table.with_columns(pl.lit("").alias(f"true_{what}") for what in POSE).write_csv(trial / "images.csv")
    export_trial(trial, "tum", out=tmp_path / "tum")
    assert sorted(path.name for path in (tmp_path / "tum").iterdir()) == ["camera_estimated.txt", "estimated.txt"]
    with pytest.raises(InputError, match="try --poses estimated"):
        export_trial(trial, "colmap", out=tmp_path / "colmap")
    assert export_trial(trial, "colmap", out=tmp_path / "colmap", poses="estimated").holds["photographs"] == 2


def test_a_photograph_that_went_away_leaves_nothing_half_written(trial: Path, tmp_path: Path) -> None:
    """The folder is whole or not there."""
    (trial / "images" / "001.png").unlink()
    for to in ("nerfstudio", "colmap"):
        with pytest.raises(InputError, match=r"001\.png"):
            export_trial(trial, to, out=tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["trial"]


def test_a_format_that_fails_midway_leaves_nothing(trial: Path, tmp_path: Path) -> None:
    """A bag of which a photograph is no JPEG or PNG: refused after messages were written, and gone."""
    pytest.importorskip("rosbags")
    (trial / "images" / "001.png").rename(trial / "images" / "001.tif")
    text = (trial / "images.csv").read_text()
    (trial / "images.csv").write_text(text.replace("001.png", "001.tif"))
    with pytest.raises(InputError, match=r"\.jpg or \.png"):
        export_trial(trial, "rosbag2", out=tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["trial"]


def test_a_folder_that_holds_something_is_not_replaced(trial: Path, tmp_path: Path) -> None:
    """A folder of the user's own stays as it is."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("dear")
    with pytest.raises(InputError, match="not empty"):
        export_trial(trial, "tum", out=tmp_path / "mine")
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "dear"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["export"], "folder of a trial"),
        (["export", "nowhere", "--to", "tum"], "no such folder"),
        (["export", "trial/images.csv", "--to", "colmap"], "is a file; give a trial's folder"),
        (["export", "trial", "--to", "blender"], "nerfstudio, colmap, tum, rosbag2, qgc-plan"),
        (["export", "trial", "--to", "tum", "--poses", "mine"], "true, estimated"),
        (["export", "trial", "--to", "tum", "--vehicle", "paper"], "--vehicle is for auv_controllers"),
        (["export", "trial", "--to", "tum", "--origin", "1,2"], "qgc-plan only"),
        (["export", "trial", "--to", "qgc-plan"], "LAT,LON"),
        (["export", "trial", "--to", "qgc-plan", "--origin", "here"], "36.52,-6.28"),
        (["export", "trial", "--to", "qgc-plan", "--origin", "91,0"], "-89 to 89"),
        (["export", "trial", "--to", "tum", "--seed", "1"], "nerfstudio and colmap only"),
        (["export", "trial", "--to", "colmap", "--held-out", "1"], "one photograph in 2 and more"),
        (["export", "empty", "--to", "tum"], "no steps.parquet"),
        (["export", "empty", "--to", "rosbag2"], "no steps.parquet"),
        (["export", "empty", "--to", "colmap"], "no images.csv; give the folder of a trial"),
        (["export", "model", "--to", "colmap"], "no trial; its COLMAP model is in model/sparse"),
        (["export", "broken", "--to", "tum"], "no Parquet"),
        (["export", "--to", "auv_controllers"], "--vehicle NAME"),
        (["export", "trial", "--to", "auv_controllers", "--vehicle", "paper"], "no trial"),
        (["export", "--to", "auv_controllers", "--vehicle", "submarine"], "not in the library"),
        (["export", "--to", "auv_controllers", "--vehicle", "paper", "--frame", "enu"], "flu, fsd"),
    ],
)
def test_bad_words_are_one_line(
    words: list[str], said: str, capsys: Capsys, trial: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, one line on standard error that says what is allowed, and nothing is written."""
    monkeypatch.chdir(trial.parent)
    (trial.parent / "empty").mkdir()
    (trial.parent / "broken").mkdir()
    (trial.parent / "broken" / "steps.parquet").write_text("no table")
    (trial.parent / "model").mkdir()
    (trial.parent / "model" / "reconstruction.json").write_text("{}")
    before = sorted(trial.parent.rglob("*"))
    assert run(words) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("wakewise:")]
    assert said in line
    assert sorted(trial.parent.rglob("*")) == before


def test_a_bag_without_rosbags_names_the_extra(capsys: Capsys, trial: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 2 and how to install it."""
    monkeypatch.setattr("wakewise.core.optional_dependencies._is_here", lambda module: module != "rosbags")
    assert run(["export", str(trial), "--to", "rosbag2"]) == 2
    assert "pip install -e '.[ros]'" in capsys.readouterr().err
    assert not (trial / "export").exists()


def test_help_says_what_a_bag_holds(capsys: Capsys) -> None:
    """Whose camera it is, and where its times begin."""
    assert run(["export", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "a bag's camera_info is the crew's calibration" in said
    assert "they begin near 0" in said


def test_the_command_says_what_it_wrote(capsys: Capsys, trial: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where and how much, for people and as JSON; a vehicle's matrix lands in the working folder."""
    monkeypatch.chdir(trial.parent)
    assert run(["export", "trial", "--to", "tum"]) == 0
    assert capsys.readouterr().out == "trial/export/tum: 6 poses, 2 camera poses\n"
    assert run(["export", "--vehicle", "paper", "--to", "auv_controllers", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {"to": "auv_controllers", "path": "paper-auv_controllers.yaml", "thrusters": 8}
    assert Path("paper-auv_controllers.yaml").is_file()
