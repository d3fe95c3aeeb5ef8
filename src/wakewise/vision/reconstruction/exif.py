"""What a camera wrote into a photograph about itself."""

from __future__ import annotations

import io
import struct

# Tags of Exif 3.0 (CIPA DC-008-2023), tables 4 and 8: what tells one lens, or one state of a zoom, from another.
_MAKE, _MODEL, _EXIF, _FOCAL, _BODY_SERIAL, _LENS_MODEL = 0x010F, 0x0110, 0x8769, 0x920A, 0xA431, 0xA434


UNREADABLE = (OSError, SyntaxError, ValueError, LookupError, TypeError, ZeroDivisionError, struct.error)
"""What Pillow raises of pictures that only other decoders take, and of notes that are damaged."""


def exif_words(data: bytes) -> str:
    """What an encoded image says of its camera: make, model, serial number, lens, focal length; empty if nothing."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            tags = image.getexif()
            more = tags.get_ifd(_EXIF)
    except (*UNREADABLE, Image.DecompressionBombError):
        return ""
    words = [_clean(tags.get(tag)) for tag in (_MAKE, _MODEL)] + [_clean(more.get(_BODY_SERIAL))]
    words.append(_clean(more.get(_LENS_MODEL)))
    try:
        focal_mm = float(more.get(_FOCAL) or 0.0)
    except (TypeError, ValueError, ZeroDivisionError):
        focal_mm = 0.0
    words.append(f"{focal_mm:.4g} mm" if focal_mm > 0.0 else "")
    return " ".join(word for word in words if word)


def _clean(value: object) -> str:
    """A tag's text without the spaces and zeros that cameras fill it up with; at most 64 printable characters."""
    text = str(value) if isinstance(value, str) else ""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:64]
