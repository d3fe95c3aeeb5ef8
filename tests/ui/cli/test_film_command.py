"""`wakewise film` and `wakewise colour`: what is asked for wrongly is one line, and colour leaves its pictures."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["film"], "either the folder"),
        (["film", "a", "--rows", "b"], "either the folder"),
        (["film", "nowhere"], "no such folder"),
        (["film", "nowhere", "--view", "up"], "camera"),
        (["film", "nowhere", "--out", "a.gif"], ".webp"),
        (["film", "nowhere", "--seconds", "0"], "1 to 3600"),
        (["film", "--rows", "nowhere"], "no such folder"),
        (["film", "--rows", "nowhere", "--at", "soon"], "0,5,10"),
        (["film", "--rows", "nowhere", "--out", "a.mp4"], ".png"),
        (["colour", "nowhere"], "nowhere"),
    ],
)
def test_bad_words_are_one_line(
    words: list[str], said: str, capsys: Capsys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, one line on standard error that says what is allowed, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    assert run(words) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("wakewise:")]
    assert len(lines) == 1
    assert said in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_colour_leaves_a_folder_of_pictures(capsys: Capsys, tmp_path: Path) -> None:
    """Each photograph has its JPEG; without a model the water's figures are null, with a reason."""
    (tmp_path / "photos").mkdir()
    for k in range(2):
        image = np.random.default_rng(k).integers(0, 255, (48, 64, 3), np.uint8)
        cv2.imwrite(str(tmp_path / "photos" / f"{k}.png"), image)
    assert run(["colour", str(tmp_path / "photos"), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["balanced"] == 2
    assert answer["veil"] is None
    assert answer["why"]["veil"]
    assert sorted(path.name for path in (tmp_path / "photos-colour").iterdir()) == ["0.jpg", "1.jpg"]
