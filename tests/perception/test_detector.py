"""The Protocol of detectors, the checked call, and detectors by name."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from wakewise.core import optional_dependencies, plugins
from wakewise.core.errors import InputError, MissingExtra, StageError
from wakewise.perception.detector import Detection, detect_checked, find_detector

IMAGE = np.zeros((20, 24, 3), dtype=np.uint8)
MODULE = '''
"""Detectors of a package from outside."""

class Whole:
    name = "whole"

    def detect(self, image):
        return ()

class Nameless(Whole):
    name = None

def broken():
    raise OSError("no weights")

number = 3
make_number = lambda: 3
'''


def square(score: object = 0.5, name: str = "", size: int = 4, shape: tuple[int, int] = (20, 24)) -> Detection:
    """Detection of a square with its corner at (5, 3) px."""
    mask = np.zeros(shape, dtype=bool)
    mask[3 : 3 + size, 5 : 5 + size] = True
    return Detection(mask=mask, score=score, name=name)


@dataclass
class Answering:
    """Detector with a fixed answer; an exception is raised."""

    answer: object
    name: str = "fixed"
    seen: list = field(default_factory=list)

    def detect(self, image):
        self.seen.append(image.shape)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with an entry point, as pip would leave it."""
    (tmp_path / "outside_detectors.py").write_text(MODULE)
    about = tmp_path / "outside_detectors-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: outside-detectors\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[wakewise.detectors]\nwhole = outside_detectors:Whole\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    plugins._offered.cache_clear()
    yield tmp_path
    plugins._offered.cache_clear()
    sys.modules.pop("outside_detectors", None)


def test_the_box_is_that_of_the_mask():
    """Right and bottom are exclusive; an empty mask has a box of zeros."""
    assert square().box == (5, 3, 9, 7)
    empty = Detection(mask=np.zeros((4, 4), dtype=bool), score=0.1)
    assert (empty.box, empty.mask.any()) == ((0, 0, 0, 0), False)


def test_a_right_answer_is_given_best_first():
    """The checked call keeps all detections and sorts them by score; equal scores keep their order."""
    answer = (square(0.2, "a"), square(np.float32(0.9), "b"), square(0.2, "c"), square(1, "d"))
    detector = Answering(answer)
    assert [one.name for one in detect_checked(detector, IMAGE)] == ["d", "b", "a", "c"]
    assert detector.seen == [(20, 24, 3)]
    assert detect_checked(Answering(()), IMAGE) == ()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ([square()], "detector fixed: gave a list, must be a tuple of Detection"),
        (None, "gave a NoneType, must be a tuple of Detection"),
        ((square(), "fish"), "detection 2 of 2: a str, must be a Detection"),
        ((square(shape=(10, 12)),), r"detection 1 of 1: mask of shape \(10, 12\), must be \(20, 24\)"),
        ((Detection(mask=np.ones((20, 24)), score=0.5),), "mask of float64, must be an array of bool"),
        ((Detection(mask=[[True]], score=0.5),), "mask of list, must be an array of bool"),
        ((square(size=0),), "mask is empty, must hold at least one pixel"),
        ((square(float("nan")),), "score nan, must be a number of 0 to 1"),
        ((square(float("inf")),), "score inf, must be a number of 0 to 1"),
        ((square(1.01),), "score 1.01, must be a number of 0 to 1"),
        ((square("high"),), "score 'high', must be a number of 0 to 1"),
        ((square(True),), "score True, must be a number of 0 to 1"),
        ((square(name=7),), "name 7, must be text"),
    ],
)
def test_an_answer_that_breaks_the_protocol_is_refused(answer, message):
    """The message names the detector, the detection and what is allowed, on one line."""
    with pytest.raises(InputError, match=message) as refusal:
        detect_checked(Answering(answer), IMAGE)
    assert str(refusal.value).startswith("detector fixed: ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("image", [None, IMAGE.astype(float), IMAGE[:, :, 0], IMAGE[:0], IMAGE[:, :, :2]])
def test_a_picture_of_another_form_is_refused(image):
    """Only uint8 arrays of shape (h, w, 3) with pixels reach a detector."""
    detector = Answering(())
    with pytest.raises(InputError, match=r"picture: .+ must be .*uint8"):
        detect_checked(detector, image)
    assert detector.seen == []


def test_an_exception_of_a_detector_is_a_stage_error_with_its_name():
    """The message is one line; the exception is the cause."""
    fault = RuntimeError("CUDA\nout of patience")
    with pytest.raises(StageError, match="detector fixed: failed, RuntimeError: CUDA out of patience") as raised:
        detect_checked(Answering(fault), IMAGE)
    assert raised.value.__cause__ is fault


@pytest.mark.parametrize("name", ["whole", "outside_detectors:Whole"])
def test_detectors_are_found_by_entry_point_and_by_module(outside, name):
    """Both names give a detector that can be called."""
    detector = find_detector(name)
    assert detector.name == "whole"
    assert detect_checked(detector, IMAGE) == ()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("whale", "detector: 'whale' is unknown, allowed: whole, package.module:make, .+, did you mean whole"),
        ("outside_detectors:nothing", "detector 'outside_detectors:nothing': cannot be loaded, AttributeError"),
        ("no_such_module:make", "detector 'no_such_module:make': cannot be loaded, ModuleNotFoundError"),
        ("outside_detectors:number", "'outside_detectors:number': cannot be made, TypeError"),
        ("outside_detectors:make_number", "3 has no detect, must be a detector with detect"),
        ("outside_detectors:broken", "'outside_detectors:broken': cannot be made, OSError: no weights"),
        ("outside_detectors:Nameless", "'outside_detectors:Nameless': name: None is a NoneType, must be a str"),
        (7, "detector: 7 is a int, must be a str"),
    ],
)
def test_a_name_that_stands_for_no_detector_is_refused(outside, name, message):
    """The message names what was asked for and why it is no detector."""
    with pytest.raises(InputError, match=message):
        find_detector(name)


def test_an_onnx_file_needs_the_extra(monkeypatch):
    """Without ONNX Runtime the message names the extra, before the file is looked for."""
    monkeypatch.setattr(optional_dependencies, "_is_here", lambda module: module != "onnxruntime")
    with pytest.raises(MissingExtra, match=r"an ONNX detector needs onnxruntime, .*'\.\[detector\]'"):
        find_detector("no/such/Model.ONNX")
