"""A computer that fails is no measurement: nothing is kept of it, and the same command does the stage again."""

import errno
import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from wakewise.core.errors import EnvironmentFailure
from wakewise.experiments.trials import trial as trials
from wakewise.experiments.trials.stages import StageCosts
from wakewise.operation import Parts, load_scenario
from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise.vision.reconstruction.sfm import features
from wakewise_paper import photo_robustness, photo_sets
from wakewise_paper.photo_sets import PhotoSet

TINY = {
    "mission.elevations_deg": [40],
    "mission.views": [3],
    "target.kind": "brain",
}
OLD = "match: the disk of /x is full, 12.8 MB are left and about 21.5 MB needed; the stages before it are kept"


@pytest.fixture
def flown(tmp_path: Path) -> tuple[Parts, Path]:
    """A trial's folder after its photographs, which show nothing in common."""
    rng = np.random.default_rng(0)
    (tmp_path / "images").mkdir()
    head = "name,est_x_m,est_y_m,est_z_m,est_qw,est_qx,est_qy,est_qz,true_x_m,true_y_m,true_z_m"
    rows = [head]
    for k in range(3):
        cv2.imwrite(str(tmp_path / "images" / f"{k}.png"), rng.integers(0, 255, (120, 160, 3), dtype=np.uint8))
        rows.append(f"{k}.png,{0.1 * k},0,0,1,0,0,0,{0.1 * k},0,0")
    (tmp_path / "images.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "cameras.txt").write_text("1 OPENCV 160 120 150 150 80 60 0 0 0 0\n")
    scenario = load_scenario("quick", None, TINY)
    return scenario.parts(), tmp_path


def _fill(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def _forbid(*_: object, **__: object) -> None:
    raise PermissionError(errno.EACCES, "Permission denied", "database.db")


@pytest.mark.parametrize("fault", [_fill, _forbid])
def test_a_computer_that_fails_leaves_no_model_and_the_next_run_tries_again(
    fault: object, flown: tuple[Parts, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk or a lacking permission writes no model.json; photographs that do not fit together then do."""
    parts, folder = flown
    with monkeypatch.context() as patch:
        patch.setattr(features.shutil, "copyfile", fault)
        with pytest.raises(EnvironmentFailure, match="match: "):
            trials.reconstruct_trial(parts, folder, lambda *_: None)
    assert not (folder / "model.json").exists()
    trials.reconstruct_trial(parts, folder, lambda *_: None)
    assert "show the same thing" in json.loads((folder / "model.json").read_text())["failure"]


def test_a_vanished_photograph_is_no_measured_failure(
    flown: tuple[Parts, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Photographs that were there and cannot be read any more say nothing about the model."""
    parts, folder = flown
    monkeypatch.setattr("wakewise.vision.reconstruction.photos.photo_folder.PhotoStore.keep", lambda *_: None)
    real = features.folder_features

    def later(*arguments: object) -> object:
        shutil.rmtree(folder / "images")
        return real(*arguments)

    monkeypatch.setattr(features, "folder_features", later)
    with pytest.raises(EnvironmentFailure, match="can no longer be read"):
        trials.reconstruct_trial(parts, folder, lambda *_: None)
    assert not (folder / "model.json").exists()


@pytest.mark.parametrize("failure", [OLD, "match: 0.png: Permission denied; the stages before it are kept"])
def test_a_full_disk_that_was_kept_as_a_result_is_forgotten(failure: str, tmp_path: Path) -> None:
    """model.json and score.json of an old run are removed if they tell of the disk, and stay if of the photographs."""
    for said, left in ((failure, []), ("mapping: none of the 6 photos register", ["model.json", "score.json"])):
        (tmp_path / "model.json").write_text(json.dumps({"figures": {}, "failure": said}))
        (tmp_path / "score.json").write_text("{}")
        trials._forget_what_was_not_measured(tmp_path)
        assert sorted(path.name for path in tmp_path.iterdir()) == left


def test_a_photo_set_is_not_judged_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`judge`, which the degradation study asks, lets the failure out instead of making a figure of it."""

    def fail(*_: object, **__: object) -> None:
        raise EnvironmentFailure("match: the disk is full")

    monkeypatch.setattr(photo_sets, "reconstruct", fail)
    target = load_scenario("quick", None, TINY).parts().target
    photos = PhotoSet(
        folder=tmp_path,
        names=("0.png",),
        focal_px=100.0,
        true_W_m=np.zeros((1, 3)),
        est_W_m=np.zeros((1, 3)),
        est_R_WC=np.eye(3)[None],
    )
    with pytest.raises(EnvironmentFailure):
        photo_sets.judge(photos, target, ReconstructionSettings(), tmp_path / "model")


def test_a_level_that_met_a_full_disk_is_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The study goes over a level of an old run whose failure was the disk's, and keeps one that was measured."""
    done: list[float] = []

    def one(scenario: object, target: object, factor: str, level: float, *_: object) -> dict[str, object]:
        done.append(level)
        return {"factor": factor, "level": level, "failure": None}

    monkeypatch.setattr(photo_robustness, "_one", one)
    scenario = load_scenario("quick", None, TINY)
    photo_robustness.degrade(scenario, tmp_path, {"blur": (0.0, 1.0)})
    (tmp_path / "blur" / "0.json").write_text(json.dumps({"failure": OLD}))
    photo_robustness.degrade(scenario, tmp_path, {"blur": (0.0, 1.0)})
    assert done == [0.0, 1.0, 0.0]


def test_a_ledger_that_cannot_be_written_does_not_hide_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first failure is the one that is told; a full disk that only the file of costs met is told too."""
    monkeypatch.setattr("wakewise.experiments.trials.stages.write_json", _fill)
    stage_costs = StageCosts(tmp_path / "stages.json")
    with pytest.raises(EnvironmentFailure, match="first"), stage_costs.account("fly"):
        raise EnvironmentFailure("first")
    with pytest.raises(OSError, match="No space"), stage_costs.account("fly"):
        pass
