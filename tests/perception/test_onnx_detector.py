"""ONNX models as detectors; the networks are built here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx_encoder as onnx
import pytest

from wakewise.core.errors import InputError, StageError
from wakewise.perception.detector import detect_checked, find_detector
from wakewise.perception.onnx_detector import MOST, load_onnx_detector
from wakewise.perception.onnx_model import OnnxModel

pytest.importorskip("onnxruntime", reason="needs ONNX Runtime, of the extra `detector`")

ANY = (1, 3, "H", "W")
RED, DARK_RED, BLUE, GREY = (255, 0, 0), (160, 0, 0), (0, 0, 255), (128, 128, 128)
GAIN, OFFSET = 10.0, -4.0
"""Logit of the red finder: GAIN (r - g - b) + OFFSET, for colours of 0 to 1."""
SMALL = {"width": 32, "height": 24}


def picture(squares, size=(48, 64)):
    """Grey picture of (height, width) px with squares as {(left, top, side): colour}."""
    image = np.full((*size, 3), GREY, dtype=np.uint8)
    for (left, top, side), colour in squares.items():
        image[top : top + side, left : left + side] = colour
    return image


def mask_of(left, top, side, size=(48, 64)):
    mask = np.zeros(size, dtype=bool)
    mask[top : top + side, left : left + side] = True
    return mask


def write(
    path: Path,
    *,
    shape=ANY,
    kind=onnx.FLOAT,
    weights=((1.0, -1.0, -1.0),),
    biases=(OFFSET,),
    gain=GAIN,
    last=None,
    metadata=None,
) -> Path:
    """A network of one 1x1 convolution, with one output channel for each row of weights; `last` is one more node."""
    nodes, source = [], "image"
    if kind == onnx.UINT8:
        nodes.append(onnx.node("Cast", [source], "cast", to=onnx.FLOAT))
        source = "cast"
    if shape[1] != 3:
        nodes.append(onnx.node("Transpose", [source], "turned", perm=[0, 3, 1, 2]))
        source = "turned"
    nodes.append(onnx.node("Conv", [source, "W", "b"], "values" if last else "mask"))
    if last:
        nodes.append(onnx.node(last, ["values"], "mask", **({"axis": 1} if last == "Softmax" else {})))
    kernel = gain * np.array(weights, dtype=np.float32)[:, :, None, None]
    held = {"W": kernel.astype(np.float32), "b": np.array(biases, dtype=np.float32)}
    output = onnx.value_info("mask", onnx.FLOAT, (1, len(weights), "h", "w"))
    path.write_bytes(onnx.model(nodes, [onnx.value_info("image", kind, shape)], [output], held, metadata or {}))
    return path


def write_constants(path: Path, outputs, metadata=None, inputs=1) -> Path:
    """A model whose outputs do not depend on the image."""
    nodes = [onnx.node("Identity", [f"{name}_0"], name) for name in outputs]
    infos = [onnx.value_info(name, onnx._TYPES[array.dtype], array.shape) for name, array in outputs.items()]
    images = [onnx.value_info(f"image{k}", onnx.FLOAT, ANY) for k in range(inputs)]
    held = {f"{name}_0": array for name, array in outputs.items()}
    path.write_bytes(onnx.model(nodes, images, infos, held, metadata or {}))
    return path


def floats(*rows):
    return np.array(rows, dtype=np.float32)


def test_two_red_squares_are_two_detections(tmp_path):
    """Masks are exact, the redder square is first, and the score is the mean probability."""
    image = picture({(4, 6, 10): DARK_RED, (30, 20, 12): RED})
    detector = find_detector(str(write(tmp_path / "red.onnx")))
    best, other = detect_checked(detector, image)
    assert np.array_equal(best.mask, mask_of(30, 20, 12))
    assert np.array_equal(other.mask, mask_of(4, 6, 10))
    assert best.box == (30, 20, 42, 32)
    assert best.score == pytest.approx(1.0 / (1.0 + np.exp(-(GAIN + OFFSET))), abs=1e-6)
    assert other.score == pytest.approx(1.0 / (1.0 + np.exp(-(GAIN * 160 / 255 + OFFSET))), abs=1e-6)
    assert best.name == other.name == ""


def test_a_model_runs_once_as_it_is_loaded_and_its_file_names_the_detector(tmp_path, monkeypatch):
    """One call shows whether it can be run."""
    calls, run = [], OnnxModel.run
    monkeypatch.setattr(OnnxModel, "run", lambda model, image: calls.append(image.shape) or run(model, image))
    detector = load_onnx_detector(write(tmp_path / "red.onnx"), threads=2, **SMALL)
    assert detector.name == "red"
    assert calls == [(SMALL["height"], SMALL["width"], 3)]


def test_a_uniform_picture_has_no_detection(tmp_path):
    """A grey picture gives an empty tuple."""
    detector = load_onnx_detector(write(tmp_path / "red.onnx"), **SMALL)
    assert detect_checked(detector, picture({})) == ()


def test_small_parts_are_left_out(tmp_path):
    """`wakewise.least_area` is a share of the picture: 16 of 3072 px are 0.0052."""
    image = picture({(4, 6, 4): RED, (30, 20, 12): RED})
    for least, count in (("0.005", 2), ("0.0053", 1), ("1", 0)):
        path = write(tmp_path / "red.onnx", metadata={"wakewise.least_area": least})
        assert len(load_onnx_detector(path, **SMALL).detect(image)) == count


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        ((1, "H", "W", 3), onnx.FLOAT),
        ((1, "H", "W", 3), onnx.UINT8),
        (ANY, onnx.UINT8),
        (("N", 3, "H", "W"), onnx.FLOAT),
    ],
)
def test_each_layout_and_type_gives_the_same_masks(tmp_path, shape, kind):
    """Channels may be last, pixels may be uint8, and the batch may be dynamic."""
    gain = GAIN / 255.0 if kind == onnx.UINT8 else GAIN
    detector = load_onnx_detector(write(tmp_path / "red.onnx", shape=shape, kind=kind, gain=gain), **SMALL)
    (found,) = detect_checked(detector, picture({(30, 20, 12): RED}))
    assert np.array_equal(found.mask, mask_of(30, 20, 12))


def test_a_layout_that_the_shape_leaves_open_is_read_from_the_metadata(tmp_path):
    """A model for pictures 3 px wide fits both layouts: without `wakewise.layout` it is refused."""
    path = write(tmp_path / "red.onnx", shape=(1, 3, "H", 3))
    with pytest.raises(InputError, match=r"fits both layouts: must have wakewise\.layout"):
        load_onnx_detector(path, **SMALL)
    path = write(tmp_path / "red.onnx", shape=(1, 3, "H", 3), metadata={"wakewise.layout": "nchw"})
    assert load_onnx_detector(path, **SMALL).detect(picture({})) == ()


@pytest.mark.parametrize("scale", [2, 0.5])
def test_a_fixed_size_is_resized_to_and_back(tmp_path, scale):
    """Masks have the picture's size, within a pixel of the squares."""
    size = (1, 3, int(48 * scale), int(64 * scale))
    detector = load_onnx_detector(write(tmp_path / "red.onnx", shape=size), **SMALL)
    (found,) = detect_checked(detector, picture({(30, 20, 12): RED}))
    assert np.abs(np.array(found.box) - (30, 20, 42, 32)).max() <= 1


def test_the_metadata_states_mean_and_standard_deviation(tmp_path):
    """(x - mean) / std reaches the network: the offset of the logit is moved there."""
    metadata = {"wakewise.mean": "0.4, 0, 0", "wakewise.std": "0.1"}
    path = write(tmp_path / "red.onnx", gain=1.0, biases=(0.0,), metadata=metadata)
    (found,) = load_onnx_detector(path, **SMALL).detect(picture({(30, 20, 12): RED}))
    assert found.score == pytest.approx(1.0 / (1.0 + np.exp(-6.0)), abs=1e-6)


def test_probabilities_are_taken_as_they_are_and_the_threshold_is_read(tmp_path):
    """A sigmoid in the network gives the same scores; a threshold between two scores keeps one square."""
    image = picture({(4, 6, 10): DARK_RED, (30, 20, 12): RED})
    with_logits = load_onnx_detector(write(tmp_path / "logits.onnx"), **SMALL).detect(image)
    path = write(tmp_path / "shares.onnx", last="Sigmoid")
    with_shares = load_onnx_detector(path, **SMALL).detect(image)
    assert [one.score for one in with_shares] == pytest.approx([one.score for one in with_logits], abs=1e-6)
    path = write(tmp_path / "strict.onnx", last="Sigmoid", metadata={"wakewise.threshold": "0.95"})
    assert [one.box[0] for one in load_onnx_detector(path, **SMALL).detect(image)] == [30]


def test_logits_within_0_to_1_are_probabilities_unless_the_metadata_says_logits(tmp_path):
    """The logit 0.3 is below the threshold 0.5 as a probability, and above it as a logit (0.57)."""
    mask = np.full((1, 1, 6, 8), 0.3, dtype=np.float32)
    assert load_onnx_detector(write_constants(tmp_path / "a.onnx", {"mask": mask}), **SMALL).detect(picture({})) == ()
    path = write_constants(tmp_path / "b.onnx", {"mask": mask}, {"wakewise.values": "logits"})
    (found,) = load_onnx_detector(path, **SMALL).detect(picture({}))
    assert found.mask.all()
    assert found.score == pytest.approx(0.574, abs=1e-3)


@pytest.mark.parametrize("last", [None, "Softmax"])
def test_several_classes_are_told_apart_and_the_background_is_none(tmp_path, last):
    """The most probable class of a pixel counts; touching squares of two classes are two detections."""
    image = picture({(20, 20, 10): RED, (30, 20, 10): BLUE})
    path = write(
        tmp_path / "classes.onnx",
        weights=((0, 0, 0), (1, -1, -1), (-1, -1, 0.8)),
        biases=(0.0, OFFSET, OFFSET),
        gain=10.0,
        metadata={"wakewise.classes": "crab, fish"},
        last=last,
    )
    best, other = detect_checked(load_onnx_detector(path, **SMALL), image)
    assert [best.name, other.name] == ["crab", "fish"]
    assert np.array_equal(best.mask, mask_of(20, 20, 10))
    assert np.array_equal(other.mask, mask_of(30, 20, 10))


def test_boxes_are_rectangular_masks_in_the_picture(tmp_path):
    """Boxes scale with the input, are clipped to the picture, and are sorted; low scores and empty boxes are out."""
    boxes = floats((2, 4, 10, 12), (20, 10, 99, 99), (1, 1, 5, 5), (-9, -9, -1, -1))
    outputs = {"scores": floats(0.6, 0.9, 0.4, 0.99), "boxes": boxes}
    detector = load_onnx_detector(
        write_constants(tmp_path / "boxes.onnx", outputs, {"wakewise.classes": "crab"}), **SMALL
    )
    best, other = detect_checked(detector, picture({}))
    assert (best.box, np.count_nonzero(best.mask)) == ((20, 10, 64, 48), 44 * 38)
    assert (other.box, np.count_nonzero(other.mask)) == ((2, 4, 10, 12), 64)
    assert [best.score, other.score] == pytest.approx([0.9, 0.6])
    assert [best.name, other.name] == ["crab", "crab"]


def test_no_box_is_no_detection(tmp_path):
    """Outputs of length 0 give an empty tuple."""
    outputs = {"boxes": np.zeros((0, 4), dtype=np.float32), "scores": np.zeros(0, dtype=np.float32)}
    assert load_onnx_detector(write_constants(tmp_path / "none.onnx", outputs), **SMALL).detect(picture({})) == ()


def test_the_number_of_detections_is_bounded(tmp_path):
    """Of 96 squares the best are kept."""
    squares = {(8 * k + 1, 8 * j + 1, 4): (120 + k + 12 * j, 0, 0) for k in range(12) for j in range(8)}
    detector = load_onnx_detector(write(tmp_path / "red.onnx"), **SMALL)
    found = detect_checked(detector, picture(squares, (64, 96)))
    assert len(found) == MOST < len(squares)
    assert found[0].box[:2] == (89, 57)


@pytest.mark.parametrize(
    ("outputs", "message"),
    [
        ({"a": floats(0.0), "b": floats(0.0)}, "outputs a, b, must be one mask, or boxes and scores"),
        ({"mask": floats((0.0, 1.0))}, r"output 'mask' has shape \(1, 2\), must be \(1, C, h, w\)"),
        ({"mask": np.zeros((2, 1, 4, 4), dtype=np.float32)}, r"shape \(2, 1, 4, 4\), must be \(1, C, h, w\)"),
        ({"mask": np.zeros((1, 1, 4, 4), dtype=np.int64)}, "output 'mask' is int64, must be an array of float"),
        ({"mask": np.full((1, 1, 4, 4), np.nan, dtype=np.float32)}, "output 'mask' holds NaN or infinity"),
        (
            {"boxes": floats((1, 2, 3)), "scores": floats(1.0)},
            r"'boxes' of shape \(1, 3\) and 'scores' of \(1,\), must be",
        ),
        ({"boxes": floats((1, 2, 3, 4)), "scores": floats((1.0, 1.0))}, r"must be \(n, 4\) and \(n,\)"),
    ],
)
def test_other_outputs_are_refused_at_construction(tmp_path, outputs, message):
    """The message names the file, the output and what is allowed, on one line."""
    path = write_constants(tmp_path / "odd.onnx", outputs)
    with pytest.raises(InputError, match=message) as refusal:
        load_onnx_detector(path, **SMALL)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((1, 4, "H", "W"), r"input 'image' has shape \(1, 4, \?, \?\), must be \(1, 3, H, W\) or \(1, H, W, 3\)"),
        ((2, 3, "H", "W"), r"has shape \(2, 3, \?, \?\), must be"),
        ((3, "H", "W"), r"has shape \(3, \?, \?\), must be"),
    ],
)
def test_an_input_of_another_shape_is_refused(tmp_path, shape, message):
    """The message gives the shape that it has and those that are allowed."""
    outputs = [onnx.value_info("mask", onnx.FLOAT, shape)]
    nodes = [onnx.node("Relu", ["image"], "mask")]
    path = tmp_path / "odd.onnx"
    path.write_bytes(onnx.model(nodes, [onnx.value_info("image", onnx.FLOAT, shape)], outputs, {}, {}))
    with pytest.raises(InputError, match=message):
        load_onnx_detector(path, **SMALL)


def test_an_input_that_is_no_picture_is_refused(tmp_path):
    """One image of float32 or uint8 is allowed; two images or int64 are not."""
    mask = np.zeros((1, 1, 4, 4), dtype=np.float32)
    path = write_constants(tmp_path / "two.onnx", {"mask": mask}, inputs=2)
    with pytest.raises(InputError, match=r"2 inputs \(image0, image1\), must be one image"):
        load_onnx_detector(path)
    image = onnx.value_info("image", onnx.INT64, ANY)
    path.write_bytes(
        onnx.model([onnx.node("Abs", ["image"], "mask")], [image], [onnx.value_info("mask", onnx.INT64, ANY)], {}, {})
    )
    with pytest.raises(InputError, match=r"input 'image' is tensor\(int64\), must be float32 or uint8"):
        load_onnx_detector(path)


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({"wakewise.treshold": "0.5"}, "'treshold' is unknown, allowed: layout, .+ did you mean threshold"),
        ({"wakewise.layout": "hwc"}, "wakewise.layout: 'hwc' is unknown, allowed: nchw, nhwc"),
        ({"wakewise.layout": "nhwc"}, "which is not nhwc with 3 channels"),
        ({"wakewise.mean": "0.5,0.5"}, "wakewise.mean: 0.5,0.5, must be 1 or 3 finite numbers"),
        ({"wakewise.mean": "much"}, "wakewise.mean: much, must be 1 or 3 finite numbers"),
        ({"wakewise.std": "1,0,1"}, "wakewise.std: 1,0,1, must be above 0"),
        ({"wakewise.threshold": "1.5"}, "wakewise.threshold: 1.5, must be 0 to 1"),
        ({"wakewise.least_area": "nan"}, "wakewise.least_area: nan, must be 1 finite number"),
        ({"wakewise.classes": "a,b"}, "wakewise.classes has 2 names, output 'mask' needs 1"),
    ],
)
def test_metadata_that_is_wrong_is_refused(tmp_path, metadata, message):
    """Keys of others are no settings; ours must be known and in range."""
    path = write(tmp_path / "red.onnx", shape=(1, 3, 24, 32), metadata={"author": "x", **metadata})
    with pytest.raises(InputError, match=message) as refusal:
        load_onnx_detector(path, **SMALL)
    assert str(refusal.value).startswith(f"{path}: ")


def test_uint8_pixels_are_not_normalised(tmp_path):
    """A mean in the metadata of such a model is refused."""
    path = write(tmp_path / "red.onnx", kind=onnx.UINT8, metadata={"wakewise.mean": "0.5"})
    with pytest.raises(InputError, match=r"input 'image' is uint8, must have no wakewise\.mean"):
        load_onnx_detector(path)


def test_a_file_that_is_no_model_is_refused(tmp_path, capfd):
    """A missing file, a folder, a text and a cut model give one line each, and ONNX Runtime prints nothing."""
    with pytest.raises(InputError, match=r"none\.onnx: no such file, must be an ONNX model"):
        find_detector(str(tmp_path / "none.onnx"))
    (tmp_path / "folder.onnx").mkdir()
    with pytest.raises(InputError, match=r"folder\.onnx: no such file"):
        load_onnx_detector(tmp_path / "folder.onnx")
    whole = write(tmp_path / "cut.onnx").read_bytes()
    for content in (b"", b"no model\n" * 9, whole[: len(whole) // 2]):
        (tmp_path / "cut.onnx").write_bytes(content)
        with pytest.raises(InputError, match=r"cut\.onnx: cannot be read as an ONNX model, ") as refusal:
            load_onnx_detector(tmp_path / "cut.onnx")
        assert "\n" not in str(refusal.value)
    assert capfd.readouterr().err == ""


def test_a_network_that_fails_on_a_picture_ends_the_call_with_its_name(tmp_path):
    """An output that is infinite for a black picture only is a StageError of the checked call."""
    path = tmp_path / "log.onnx"
    infos = [onnx.value_info("mask", onnx.FLOAT, ANY)]
    nodes = [onnx.node("ReduceMax", ["image"], "most"), onnx.node("Log", ["most"], "mask")]
    image = onnx.value_info("image", onnx.FLOAT, ANY)
    path.write_bytes(onnx.model(nodes, [image], infos, {}, {}))
    detector = load_onnx_detector(path, **SMALL)
    assert detect_checked(detector, picture({})) == ()
    with pytest.raises(StageError, match=r"detector log: failed, InputError: .+log\.onnx: output 'mask' holds NaN"):
        detect_checked(detector, np.zeros((4, 4, 3), dtype=np.uint8))
