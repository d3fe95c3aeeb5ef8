"""What would fill the memory is refused by its header, in a line, before it is decoded; what is whole is read."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.core.size_limits import broken_ply, check_arrays, check_picture, picture_size
from wakewise.scene.targets.mesh import read_mesh
from wakewise.vision.evaluation.depth_maps import read_depth_views
from wakewise.vision.image_decoding import decode_picture, read_picture
from wakewise.vision.reconstruction import read_cloud
from wakewise.vision.reconstruction.photos.photo_folder import decode, read_photos
from wakewise.vision.texturing.photo_colours import correct_photos
from wakewise.wake.learned import load_network

SRC = Path(__file__).parents[2] / "src" / "wakewise"
SUFFIXES = (".png", ".jpg", ".tif", ".bmp", ".webp", ".gif")


def encoded(suffix: str, width: int = 37, height: int = 23, kind: type = np.uint8, channels: int = 3) -> bytes:
    image = np.random.default_rng(0).integers(0, 255, (height, width, channels)).astype(kind)
    return cv2.imencode(suffix, image)[1].tobytes()


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_bomb(width: int, height: int) -> bytes:
    """A grey PNG of so many pixels, whole but for its rows, which nobody has to unpack to refuse it."""
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0")) + chunk(b"IEND", b"")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_header_says_what_the_decoder_finds(suffix):
    """Columns before rows, in every kind that is read; and the picture comes out."""
    data = encoded(suffix)
    assert picture_size(data) == (37, 23)
    image = decode_picture(data, "a")
    assert image is not None and image.shape == (23, 37, 3)


@pytest.mark.parametrize(("suffix", "kind", "channels"), [(".tif", np.uint16, 3), (".tif", np.float32, 3),
                                                          (".png", np.uint16, 3), (".png", np.uint8, 4)])  # fmt: skip
def test_deep_and_clear_pictures_have_a_size_too(suffix, kind, channels):
    """16 bits, floats, transparency."""
    assert picture_size(encoded(suffix, kind=kind, channels=channels)) == (37, 23)


def test_a_jpeg_with_a_thumbnail_before_its_frame_has_its_own_size():
    """What stands in an EXIF segment is passed over."""
    small, data = encoded(".jpg", 8, 8), encoded(".jpg", 640, 480)
    segment = b"\xff\xe1" + struct.pack(">H", len(small) + 2) + small
    assert picture_size(data[:2] + segment + data[2:]) == (640, 480)


def bombs() -> dict[str, bytes]:
    """Headers of 900 million pixels in every kind."""
    side = 30_000
    jpeg = bytearray(encoded(".jpg"))
    at = jpeg.index(b"\xff\xc0")
    jpeg[at + 5 : at + 9] = struct.pack(">HH", side, side)
    bmp = bytearray(encoded(".bmp"))
    bmp[18:26] = struct.pack("<ii", side, -side)
    tiff = b"II*\0" + struct.pack("<IH", 8, 2) + struct.pack("<HHIIHHII", 256, 4, 1, side, 257, 4, 1, side)
    gif = b"GIF89a" + struct.pack("<HH", side, side) + bytes(9)
    webp = b"RIFF" + bytes(4) + b"WEBPVP8X" + bytes(8) + 2 * (side - 1).to_bytes(3, "little")
    return {"a.png": png_bomb(side, side), "a.jpg": bytes(jpeg), "a.bmp": bytes(bmp), "a.tif": tiff, "a.gif": gif,
            "a.webp": webp}  # fmt: skip


@pytest.mark.parametrize("name", bombs())
def test_a_picture_of_too_many_pixels_is_refused(name, tmp_path):
    """By name, with its size and what is allowed, whoever reads it, before anything is decoded."""
    data = bombs()[name]
    (tmp_path / name).write_bytes(data)
    tracemalloc.start()
    for read in (lambda: check_picture(data, name), lambda: decode(data, name), lambda: read_picture(tmp_path / name)):
        with pytest.raises(InputError, match=rf"{name}: 30000 x 30000 px, allowed are 200 million") as fault:
            read()
        assert "\n" not in str(fault.value)
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()


def test_folders_with_such_a_picture_are_refused(tmp_path):
    """For a model and for colours."""
    photos = tmp_path / "photos"
    photos.mkdir()
    (photos / "a.png").write_bytes(png_bomb(30_000, 30_000))
    for read in (lambda: read_photos(photos), lambda: correct_photos(photos, tmp_path / "out")):
        with pytest.raises(InputError, match=r"a\.png: 30000 x 30000 px"):
            read()


@pytest.mark.parametrize("data", [b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"II*\0", b"BM", b"GIF89a",
                                  b"RIFF1234WEBP", b"hello", bytes(40)])  # fmt: skip
def test_what_is_no_picture_is_none(data):
    """Too short, or of another kind."""
    assert picture_size(data) is None
    assert decode_picture(data, "a") is None


def test_pictures_are_decoded_in_one_place():
    """No other file of the package asks OpenCV or Pillow to decode; three decode what they have made themselves."""
    own = {
        "vision/image_decoding.py",
        "vision/reconstruction/photos/photo_folder.py",
        "operation/teleop/target_tracking.py",
        "ui/film/encode.py",
        "ui/reports/views.py",
    }
    header_only = {  # no pixel of it is unpacked
        "vision/photo_selection/photo_times.py",
        "vision/reconstruction/scale/position_fixes.py",
    }
    found = {
        str(path.relative_to(SRC).as_posix())
        for path in SRC.rglob("*.py")
        if any(word in path.read_text(encoding="utf-8") for word in ("imread(", "imdecode(", "Image.open("))
    }
    assert found == own | header_only


def zip_bomb(path: Path, shape: tuple[int, ...], name: str = "depth") -> None:
    """An .npz whose array is said to be of this shape; its zeros are few when packed."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f4", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{name}.npy", head.getvalue() + bytes(1000))


def test_arrays_are_measured_by_their_headers(tmp_path):
    """Shapes by name; too many bytes are refused, and what is no such file."""
    np.savez(tmp_path / "a.npz", depth=np.zeros((3, 4, 5)), other=np.zeros(2))
    assert check_arrays(tmp_path / "a.npz") == {"depth": (3, 4, 5), "other": (2,)}
    np.save(tmp_path / "a.npy", np.zeros((2, 2)))
    assert check_arrays(tmp_path / "a.npy") == {"": (2, 2)}
    zip_bomb(tmp_path / "b.npz", (1000, 1000, 1000))
    with pytest.raises(InputError, match=r"b.npz: its arrays have 7.45 GiB when they are unpacked, allowed are 4 GiB"):
        check_arrays(tmp_path / "b.npz")
    for name, data in (("c.npz", b"PK\3\4no"), ("d.npy", b"\x93NUMPY"), ("e.npz", b""), ("f.npz", b"hello")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=name):
            check_arrays(tmp_path / name)


def test_depth_maps_and_networks_are_measured_before_they_are_unpacked(tmp_path):
    """The number of maps is held against the cameras by the header; bytes are capped."""
    cameras = tmp_path / "cameras"
    cameras.mkdir()
    (cameras / "a.camera").write_text("")
    zip_bomb(tmp_path / "many.npz", (200, 100, 100))
    with pytest.raises(InputError, match=r"depth has shape \(200, 100, 100\), .* holds 1 .camera"):
        read_depth_views(tmp_path / "many.npz", cameras)
    zip_bomb(tmp_path / "huge.npz", (1, 100_000, 100_000))
    with pytest.raises(InputError, match="GiB when they are unpacked"):
        read_depth_views(tmp_path / "huge.npz", cameras)
    zip_bomb(tmp_path / "network.npz", (100_000, 100_000), "w0")
    with pytest.raises(InputError, match="GiB when they are unpacked"):
        load_network(tmp_path / "network.npz")


HEAD = "ply\nformat {}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n" \
       "property list {} int vertex_indices\nend_header\n"  # fmt: skip
CORNERS = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)


def ply(tmp_path: Path, kind: str, faces: int, counts: str, body: bytes, vertices: int = 3) -> Path:
    path = tmp_path / "list.ply"
    path.write_bytes(HEAD.format(kind, vertices, faces, counts).encode() + body)
    return path


TRIANGLE, ENDLESS = struct.pack("<B3i", 3, 0, 1, 2), struct.pack("<I3i", 4_000_000_000, 0, 1, 2)
LITTLE, ASCII = "binary_little_endian 1.0", "ascii 1.0"
BROKEN = {
    "a face of more corners than there are": (LITTLE, 1, "uint", CORNERS + ENDLESS),
    "in text": (ASCII, 1, "uint", b"0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n"),
    "more faces than there are": (LITTLE, 9, "uchar", CORNERS + 8 * TRIANGLE),
    "a quad at the end that ends early": (LITTLE, 2, "uchar", CORNERS + TRIANGLE + struct.pack("<B3i", 4, 0, 1, 2)),
    "vertices that end early": (LITTLE, 0, "uchar", CORNERS[:20]),
    "lines that end early": (ASCII, 1, "uchar", b"0 0 0\n1 0 0\n0 1 0\n"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_ply_that_promises_more_than_it_holds_is_refused(what, tmp_path):
    """As a mesh and as a cloud."""
    path = ply(tmp_path, *BROKEN[what])
    assert broken_ply(path) is not None
    for read in (read_mesh, read_cloud):
        with pytest.raises(InputError, match=r"list\.ply: was cut short, "):
            read(path)


def test_whole_ply_files_are_read(tmp_path):
    """Triangles, quads among them, text, other byte order, other properties, bytes after the end."""
    quads = struct.pack("<B4i", 4, 0, 1, 2, 0)
    for body in (3 * TRIANGLE, TRIANGLE + quads + TRIANGLE, quads + 2 * TRIANGLE, 3 * TRIANGLE + b"and more"):
        assert broken_ply(ply(tmp_path, "binary_little_endian 1.0", 3, "uchar", CORNERS + body)) is None
    big = struct.pack(">9f", *range(9)) + struct.pack(">B3i", 3, 0, 1, 2)
    assert broken_ply(ply(tmp_path, "binary_big_endian 1.0", 1, "uchar", big)) is None
    assert broken_ply(ply(tmp_path, "ascii 1.0", 1, "uchar", b"0 0 0\n1 0 0\n\n0 1 0\n3 0 1 2\n")) is None
    for text in ("binary", "ascii"):
        data = trimesh.creation.icosphere(3).export(file_type="ply", encoding=text)
        (tmp_path / "ball.ply").write_bytes(data)
        assert broken_ply(tmp_path / "ball.ply") is None
        assert len(read_mesh(tmp_path / "ball.ply").faces) == 1280
