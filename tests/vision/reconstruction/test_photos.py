"""What is and what is not a folder of photos; what is and what is not a table of cameras."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.files import write_json
from wakewise.vision.reconstruction import match_references, read_photos, read_reference_cameras
from wakewise.vision.reconstruction.photos.photo_folder import (
    PHOTOS_FILE,
    Photo,
    PhotoStore,
    decode,
    digests,
    jpeg_is_whole,
    photo_files,
    png_is_whole,
    refuse_other_photos,
    without_duplicates,
)

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))


def put(folder, *names):
    for name in names:
        cv2.imwrite(str(folder / name), np.full((20, 30, 3), 128, dtype=np.uint8))


def test_photos_are_sorted_measured_and_told_apart(tmp_path):
    """Names in order, sizes in pixels; other files are left alone; the same bytes have the same digest."""
    put(tmp_path, "b.png", "a.jpg", "c.PNG")
    (tmp_path / "images.csv").write_text("name")
    photos = read_photos(tmp_path)
    assert [p.name for p in photos] == ["a.jpg", "b.png", "c.PNG"]
    assert {(p.width, p.height) for p in photos} == {(30, 20)}
    assert photos[1].digest == photos[2].digest != photos[0].digest


@pytest.mark.parametrize("what", ["missing", "file", "empty", "none", "few", "broken", "cut"])
def test_what_is_no_folder_of_photos_is_named(tmp_path, what, capfd):
    """One line that names the folder or the file and what is needed."""
    folder = tmp_path / "photos"
    expected = {
        "missing": "does not exist",
        "file": "is a file",
        "empty": "is empty",
        "none": "notes.txt is none",
        "few": "holds 1 photos, at least 2",
        "broken": "b.png: is no image",
        "cut": "b.png: is cut short",
    }[what]
    if what == "file":
        folder.write_text("x")
    elif what != "missing":
        folder.mkdir()
    if what == "none":
        (folder / "notes.txt").write_text("x")
    if what == "few":
        put(folder, "a.png")
    if what in ("broken", "cut"):
        put(folder, "a.png", "b.png", "c.png")
        whole = (folder / "b.png").read_bytes()
        (folder / "b.png").write_bytes(b"no image" if what == "broken" else whole[: len(whole) // 2])
    with pytest.raises(InputError, match=expected) as caught:
        read_photos(folder)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_a_jpeg_cut_short_is_told_and_one_with_a_tail_is_not(tmp_path):
    """Any cut that loses the end marker is seen, whatever decoders make of it; bytes after the end do no harm."""
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (40, 60, 3), dtype=np.uint8)
    for progressive in (0, 1):
        data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])[1].tobytes()
        assert jpeg_is_whole(data)
        assert jpeg_is_whole(data + b"maker's own")
        assert not any(jpeg_is_whole(data[:n]) for n in range(2, len(data) - 1))
    put(tmp_path, "a.jpg", "c.jpg")
    (tmp_path / "b.jpg").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"b\.jpg: is cut short"):
        read_photos(tmp_path)


def test_a_wrong_suffix_is_told_with_the_right_one(tmp_path):
    """A PNG called .jpg is named with what it should be called."""
    put(tmp_path, "a.png", "b.png")
    (tmp_path / "b.png").rename(tmp_path / "b.jpg")
    with pytest.raises(InputError, match=r"b\.jpg: holds a PNG image, so its name must end in \.png"):
        read_photos(tmp_path)


def test_copies_of_a_photo_are_left_out(tmp_path):
    """Of photos with the same bytes the first stays; copies alone are refused."""
    put(tmp_path, "a.png", "b.png")
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((20, 30, 3), np.uint8))
    kept, copies = without_duplicates(read_photos(tmp_path))
    assert [photo.name for photo in kept] == ["a.png", "c.png"] and copies == 1
    (tmp_path / "c.png").unlink()
    with pytest.raises(InputError, match=r"all 2 are copies of a\.png"):
        without_duplicates(read_photos(tmp_path))


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=200))
def test_no_bytes_crash_the_decoder(data):
    """Any bytes are an image or None."""
    image = decode(data, "a.png")
    assert image is None or (image.ndim == 3 and image.dtype == np.uint8)
    assert jpeg_is_whole(b"\xff\xd8" + data) in (True, False)


def test_csv_of_cameras(tmp_path):
    """Columns by name, in any order, others ignored."""
    path = tmp_path / "cameras.csv"
    path.write_text("z_m,name,x_m,y_m,more\n3,a.png,1,2,x\n6,b.png,4,5,y\n")
    found = read_reference_cameras(path)
    assert found["a.png"].tolist() == [1, 2, 3]
    assert found["b.png"].tolist() == [4, 5, 6]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name,x_m,y_m\na,1,2\n", "no column z_m"),
        ("name,x_m,y_m,z_m\na,1,2,up\n", "line 2"),
        ("name,x_m,y_m,z_m\na,1,2,nan\n", "finite"),
        ("name,x_m,y_m,z_m\na,1\n", "line 2"),
        ("name,x_m,y_m,z_m\n", "holds no cameras"),
        ("", "no column"),
    ],
)
def test_bad_csv_is_named(tmp_path, text, expected):
    """Each fault is told with its line or column."""
    path = tmp_path / "cameras.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=expected):
        read_reference_cameras(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=120))
def test_any_bytes_are_cameras_or_an_input_error(tmp_path, data):
    """No file makes the reader fail in any other way."""
    for name in ("cameras.csv", "folder/a.png.camera"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        try:
            found = read_reference_cameras(path if path.suffix == ".csv" else path.parent)
        except InputError:
            continue
        assert all(np.all(np.isfinite(p)) and p.shape == (3,) for p in found.values())


def test_a_camera_that_is_there_twice_is_refused(tmp_path):
    """Neither of two places is taken in silence; the line is named."""
    path = tmp_path / "cameras.csv"
    path.write_text("name,x_m,y_m,z_m\na.jpg,0,0,0\nb.jpg,1,0,0\na.jpg,2,0,0\n")
    with pytest.raises(InputError, match=r"line 4: a\.jpg is there twice"):
        read_reference_cameras(path)


def test_folders_without_cameras_and_nothing_at_all(tmp_path):
    """An empty folder and a missing path are told apart."""
    with pytest.raises(InputError, match=r"holds no \.camera"):
        read_reference_cameras(tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        read_reference_cameras(tmp_path / "x")


def test_fountain_cameras_are_read():
    """The surveyed centres of a real set, a few metres apart."""
    folder = DATA / "strecha_fountain" / "gt_dense_cameras"
    if not folder.is_dir():
        pytest.skip(f"{folder.parent.name} is not among the shared data")
    found = read_reference_cameras(folder)
    centres = np.array(list(found.values()))
    assert sorted(found)[0] == "0000.jpg" and len(found) == 11
    assert 1.0 < np.linalg.norm(np.ptp(centres, axis=0)) < 20.0


def test_references_match_by_name_or_stem():
    """A reference for 1.png serves 1.jpg; photos without one are left out; fewer than three matches are refused."""
    references = {f"{k}.png": np.full(3, float(k)) for k in range(4)}
    assert set(match_references(references, ["0.png", "1.jpg", "2.png", "9.png"])) == {"0.png", "1.jpg", "2.png"}
    with pytest.raises(InputError, match=r"2 of 3 photos .*0\.png for 0\.png"):
        match_references(references, ["0.png", "1.png", "x.png"])


def test_a_png_is_whole_only_with_all_its_bytes():
    """Any cut and any changed byte is noticed, what follows the end is not looked at."""
    data = cv2.imencode(".png", np.random.default_rng(0).integers(0, 255, (9, 9, 3), dtype=np.uint8))[1].tobytes()
    assert png_is_whole(data) and png_is_whole(data + b"tail")
    assert not any(png_is_whole(data[:k]) for k in range(8, len(data)))
    for k in range(8, len(data)):
        assert not png_is_whole(data[:k] + bytes([data[k] ^ 1]) + data[k + 1 :])


def test_images_of_other_kinds_and_folders_of_folders_are_told(tmp_path):
    """A WebP under a JPEG's name, and photos two folders further down."""
    (tmp_path / "a.jpg").write_bytes(cv2.imencode(".webp", np.zeros((9, 9, 3), np.uint8))[1].tobytes())
    with pytest.raises(InputError, match=r"a\.jpg: holds an image of another kind than JPEG"):
        read_photos(tmp_path)
    (tmp_path / "all" / "left" / "day").mkdir(parents=True)
    put(tmp_path / "all" / "left" / "day", "1.png", "2.png")
    with pytest.raises(InputError, match=r"holds only folders \(left\) without photos"):
        read_photos(tmp_path / "all")


def test_a_store_decodes_once_and_only_as_much_as_it_may_keep(tmp_path):
    """What is kept outlives its file; what has no room is read again, and a file that went is told."""
    put(tmp_path, "a.png", "b.png")
    size = decode((tmp_path / "a.png").read_bytes(), "a.png").nbytes
    store = PhotoStore(tmp_path, most_bytes=size)
    assert [photo.name for photo in read_photos(tmp_path, store, threads=1)] == ["a.png", "b.png"]
    kept, other = store.image("a.png"), store.image("b.png")
    assert kept is store.image("a.png") and not kept.flags.writeable and other is not store.image("b.png")
    for name in ("a.png", "b.png"):
        (tmp_path / name).unlink()
    assert store.image("a.png") is kept
    with pytest.raises(EnvironmentFailure, match=r"b\.png: can no longer be read"):
        store.image("b.png")


def test_a_model_of_other_photos_is_not_replaced_unasked(tmp_path):
    """Photos that share none with a finished model's are refused; more of the same are taken."""
    first, more, other = (
        tuple(Photo(name=name, width=4, height=3, digest=f"{name}-digest") for name in names)
        for names in ("ab", "abc", "de")
    )
    refuse_other_photos(tmp_path, other)
    write_json(tmp_path / PHOTOS_FILE, digests(first))
    refuse_other_photos(tmp_path, more)
    with pytest.raises(InputError, match="holds a model of other photos"):
        refuse_other_photos(tmp_path, other)
    for damaged in ("", "3", "[[1]]"):
        (tmp_path / PHOTOS_FILE).write_text(damaged)
        refuse_other_photos(tmp_path, other)


def test_a_model_among_a_rigs_folders_gives_no_photos(tmp_path):
    """Pictures that a reconstruction wrote beside the folders of two cameras are not taken for a third one's."""
    for name in ("left", "right", "model"):
        (tmp_path / name).mkdir()
    put(tmp_path, "left/a.png", "right/a.png", "model/orthophoto.png")
    assert len(photo_files(tmp_path)) == 3
    (tmp_path / "model" / "reconstruction.json").write_text("{}")
    assert [path.parent.name for path in photo_files(tmp_path)] == ["left", "right"]
