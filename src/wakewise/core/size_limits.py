"""Sizes of pictures, arrays and meshes by their headers: what would fill the memory is refused before it is decoded."""

from __future__ import annotations

import math
import struct
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from wakewise.core.errors import InputError

Bytes = NDArray[np.uint8]

MOST_PIXELS = 200_000_000
"""Of a picture: twice the largest sensor that is sold; more is a damaged or a hostile file."""
MOST_BYTES = 4 << 30
"""Of the arrays of one file, unpacked into numbers of 8 bytes."""
KINDS = "JPEG, PNG, TIFF, BMP, GIF and WebP"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_NO_FRAME = {0xC4, 0xC8, 0xCC}  # among the start-of-frame markers of JPEG, those that are something else
_PLY_BYTES = {
    "char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2, "int": 4, "uint": 4,
    "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8, "float64": 8,
}  # fmt: skip
_PLY_COUNTS = {"char": "i1", "uchar": "u1", "int8": "i1", "uint8": "u1", "short": "i2", "ushort": "u2", "int16": "i2",
               "uint16": "u2", "int": "i4", "uint": "u4", "int32": "i4", "uint32": "u4"}  # fmt: skip
_MOST_HEAD_LINES, _LONGEST_LINE = 1000, 10_000


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Columns and rows of a picture as its header says; None for what is none of `KINDS`."""
    try:
        if data[:8] == b"\x89PNG\r\n\x1a\n":
            return struct.unpack(">II", data[16:24])
        if data[:2] == b"\xff\xd8":
            return _jpeg(data)
        if data[:4] in _TIFF:
            return _tiff(data)
        if data[:2] == b"BM":
            if struct.unpack("<I", data[14:18])[0] == 12:
                return struct.unpack("<HH", data[18:22])
            width, height = struct.unpack("<ii", data[18:26])
            return abs(width), abs(height)
        if data[:6] in (b"GIF87a", b"GIF89a"):
            return struct.unpack("<HH", data[6:10])
        if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
            return _webp(data)
    except (struct.error, IndexError, KeyError):
        return None
    return None


def picture_depth(data: bytes) -> tuple[int, bool]:
    """Bits of each colour, and whether a picture has transparency, as its header says; 8 and no where it does not."""
    try:
        if data[:8] == b"\x89PNG\r\n\x1a\n":
            return max(8, data[24]), data[25] in (4, 6)
        if data[:4] in _TIFF:
            found = _tiff_fields(data, (258, 338))
            return max(8, found.get(258, 8)), found.get(338, 0) in (1, 2)
    except (struct.error, IndexError, KeyError):
        pass
    return 8, False


def check_picture(data: bytes, name: str) -> bool:
    """Whether bytes begin like a picture that may be decoded.

    Raises InputError if its header says that it has more pixels than `MOST_PIXELS`.
    """
    size = picture_size(data)
    if size is not None and size[0] * size[1] > MOST_PIXELS:
        raise InputError(
            f"{name}: {size[0]} x {size[1]} px, allowed are {MOST_PIXELS / 1e6:.0f} million pixels; save it smaller"
        )
    return size is not None


def check_arrays(path: Path, most_bytes: int = MOST_BYTES) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of an .npy or .npz file, by name, "" for that of an .npy; nothing is unpacked.

    Raises InputError if the file holds no such arrays, or they have more than `most_bytes` when they are unpacked.
    """
    shapes: dict[str, tuple[int, ...]] = {}
    total = 0
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                for name in archive.namelist():
                    with archive.open(name) as file:
                        shape, size = _array(file)
                    shapes[name.removesuffix(".npy")] = shape
                    total += size
        else:
            with path.open("rb") as file:
                shapes[""], total = _array(file)
    except (OSError, ValueError, EOFError, SyntaxError, RuntimeError, NotImplementedError, zipfile.BadZipFile):
        raise InputError(f"{path}: is no .npz or .npy file with arrays that can be read") from None
    if total > most_bytes:
        raise InputError(
            f"{path}: its arrays have {total / 2**30:.3g} GiB when they are unpacked, allowed are "
            f"{most_bytes / 2**30:.3g} GiB"
        )
    return shapes


def broken_ply(path: Path) -> str | None:
    """What a PLY file holds less of than its head promises, in words; None for a whole one or another format.

    Readers take what is there, so that a file which was cut short, or has a face of more corners than it holds numbers,
    passes for a small one.
    """
    with path.open("rb") as file:
        if file.readline(_LONGEST_LINE).strip() != b"ply":
            return None
        kind, elements = _ply_head(file)
        if kind is None:
            return None
        if kind == "ascii":
            return _broken_ascii(file, elements)
        rest = np.frombuffer(file.read(), np.uint8)
    return _broken_binary(rest, ">" if kind == "binary_big_endian" else "<", elements)


Element = tuple[str, int, list[tuple[str, ...]]]
"""Name, count, and properties: (type,), or (type of the count, type of the items) of a list."""


def _ply_head(file: IO[bytes]) -> tuple[str | None, list[Element]]:
    kind: str | None = None
    elements: list[Element] = []
    for _ in range(_MOST_HEAD_LINES):
        words = file.readline(_LONGEST_LINE).decode("ascii", "replace").split()
        if words[:1] == ["end_header"]:
            return kind, elements
        if words[:1] == ["format"] and len(words) > 1:
            kind = words[1]
        elif words[:1] == ["element"] and len(words) == 3 and words[2].isdigit():
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements and len(words) > 2:
            elements[-1][2].append((words[2], words[3]) if words[1] == "list" and len(words) > 4 else (words[1],))
    return None, elements


def _broken_ascii(file: IO[bytes], elements: list[Element]) -> str | None:
    lines = [line for line in file if line.strip()]
    promised = sum(count for _, count, _ in elements)
    if len(lines) < promised:
        return f"promises {promised} vertices and faces, holds {len(lines)}"
    at = 0
    for name, count, properties in elements:
        if len(properties) == 1 and len(properties[0]) == 2:
            for line in lines[at : at + count]:
                words = line.split()
                if words[0].isdigit() and int(words[0]) > len(words) - 1:
                    return f"a {name} promises {words[0].decode()} numbers, holds {len(words) - 1}"
        at += count
    return None


def _broken_binary(rest: Bytes, order: str, elements: list[Element]) -> str | None:
    at = 0
    for name, count, properties in elements:
        known = all(word in _PLY_BYTES for kinds in properties for word in kinds)
        if not known:
            return None
        fixed = sum(_PLY_BYTES[kinds[0]] for kinds in properties if len(kinds) == 1)
        if all(len(kinds) == 1 for kinds in properties):
            at += count * fixed
            if at > len(rest):
                lacking = math.ceil((at - len(rest)) / max(fixed, 1))
                return f"promises {count} of {name}, holds {max(0, count - lacking)}"
            continue
        if len(properties) > 1:
            return None  # lists among other properties: the reader's own checks have to do
        counts, items = properties[0]
        if counts not in _PLY_COUNTS:
            return None
        at = _after_lists(rest, at, count, np.dtype(order + _PLY_COUNTS[counts]), _PLY_BYTES[items])
        if at > len(rest):
            return f"promises {count} of {name} and the numbers of each, holds less"
    return None


def _after_lists(rest: Bytes, at: int, count: int, kind: np.dtype[Any], item: int) -> int:
    """Where `count` lists end; beyond the end of the data where they do not fit."""
    head = kind.itemsize
    done = 0
    while done < count:
        if at + head > len(rest):
            return len(rest) + 1
        length = int(rest[at : at + head].view(kind)[0])
        step = head + max(length, 0) * item
        # As many of the same length as follow: of a surface of triangles all.
        most = min(count - done, (len(rest) - at) // step)
        if most == 0:
            return len(rest) + 1
        rows = rest[at : at + most * step].reshape(most, step)[:, :head]
        same = np.ascontiguousarray(rows).view(kind)[:, 0] == length
        run = most if same.all() else int(np.argmin(same))
        at, done = at + run * step, done + run
    return at


def _array(file: IO[bytes]) -> tuple[tuple[int, ...], int]:
    """Shape and bytes of an array by its header."""
    version = np.lib.format.read_magic(file)
    read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}.get(version)
    if read is None:
        raise ValueError(f"version {version} of the format")
    shape, _, dtype = read(file)
    return shape, math.prod(shape) * max(dtype.itemsize, 8)


def _jpeg(data: bytes) -> tuple[int, int] | None:
    at = 2
    while at + 9 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF or 0xD0 <= marker <= 0xD9 or marker == 0x01:
            at += 1 if marker == 0xFF else 2
            continue
        if 0xC0 <= marker <= 0xCF and marker not in _NO_FRAME:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        at += 2 + struct.unpack(">H", data[at + 2 : at + 4])[0]
    return None


def _tiff(data: bytes) -> tuple[int, int] | None:
    found = _tiff_fields(data, (256, 257))
    return (found[256], found[257]) if len(found) == 2 else None


def _tiff_fields(data: bytes, tags: tuple[int, ...]) -> dict[int, int]:
    """First values of fields of the first picture of a TIFF file, those that it has."""
    order = "<" if data[:2] == b"II" else ">"
    big = data[2:4] in (b"+\0", b"\0+")
    offset = struct.unpack(order + ("Q" if big else "I"), data[8:16] if big else data[4:8])[0]
    head, entry = (8, 20) if big else (2, 12)
    entries = struct.unpack(order + ("Q" if big else "H"), data[offset : offset + head])[0]
    found: dict[int, int] = {}
    for k in range(min(entries, 500)):
        row = data[offset + head + k * entry : offset + head + (k + 1) * entry]
        tag, kind = struct.unpack(order + "HH", row[:4])
        if tag not in tags:
            continue
        form, size = {3: ("H", 2), 4: ("I", 4), 16: ("Q", 8)}[kind]
        count = struct.unpack(order + ("Q" if big else "I"), row[4:12] if big else row[4:8])[0]
        value = row[12:] if big else row[8:]
        if count * size > len(value):
            at = struct.unpack(order + ("Q" if big else "I"), value)[0]
            value = data[at : at + size]
        found[tag] = struct.unpack(order + form, value[:size])[0]
    return found


def _webp(data: bytes) -> tuple[int, int] | None:
    kind, body = data[12:16], data[20:30]
    if kind == b"VP8X":
        return 1 + int.from_bytes(body[4:7], "little"), 1 + int.from_bytes(body[7:10], "little")
    if kind == b"VP8L":
        bits = int.from_bytes(body[1:5], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if kind == b"VP8 ":
        width, height = struct.unpack("<HH", body[6:10])
        return width & 0x3FFF, height & 0x3FFF
    return None
