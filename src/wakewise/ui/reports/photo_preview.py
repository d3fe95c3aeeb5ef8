"""The page of a look at photographs: what to shoot again, then every photograph with what was seen of it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

from wakewise.core.files import write_text
from wakewise.ui.reports.page import collapsible_section, section, tile, whole_page
from wakewise.ui.reports.svg_style import data_uri
from wakewise.ui.reports.text import fixed, shown
from wakewise.vision.reconstruction.quality.photo_preview import PhotoPreview, PhotoQuality

MOST_BAD = 0.1
"""Share of the photographs to look at again up to which a dive is fair, and not bad."""


def write_look(look: PhotoPreview, thumbs: Mapping[str, bytes], path: Path, title: str) -> None:
    """Write a look as one HTML file that opens with no network.

    Parameters
    ----------
    thumbs : mapping
        JPEG bytes by photo's name.
    """
    write_text(path, look_page(look, thumbs, title))


def look_page(look: PhotoPreview, thumbs: Mapping[str, bytes], title: str) -> str:
    """HTML of a look."""
    bad = [photo for photo in look.photos if photo.faults]
    good = [photo for photo in look.photos if not photo.faults]
    count = len(look.photos)
    sizes = [size for size in look.groups if size is not None]
    together = max(sizes, default=None)
    whole = together is not None and sum(size > 1 for size in sizes) == 1 and together >= 0.9 * count
    state = "bad" if not whole or len(bad) > MOST_BAD * count else "fair" if bad else "good"
    headline = (
        f"{len(bad)} of {count} photographs to look at again" if bad else f"{count} photographs, nothing to shoot again"
    )
    if not whole:
        headline = f"The photographs do not hang together: {shown(together)} of {count} do"
    partners = sorted(len(photo.partners) for photo in look.photos)[count // 2]
    shares = sorted(photo.covered_pct for photo in look.photos if photo.covered_pct is not None)
    covered = shares[len(shares) // 2] if shares else None
    blurred = sum(any("blurred" in fault for fault in photo.faults) for photo in look.photos)
    light = sum(any("dark" in f or "burnt" in f for f in photo.faults) for photo in look.photos)
    first = look.photos[0]
    tiles = (
        tile("photographs", str(count), "", f"{shown(first.width)} x {shown(first.height)} px")
        + tile("hang together", shown(together), f"of {count}", "by their overlap", "ok" if whole else "off")
        + tile("partners each", str(partners), "", "photos that overlap it, median", "ok" if partners >= 4 else "off")
        + tile("covered", fixed(covered, 0), "%", "of a photo is in two others, median")
        + tile("blurred", str(blurred), "", "of them", "ok" if blurred == 0 else "off")
        + tile("light", str(light), "", "too dark or burnt out", "ok" if light == 0 else "off")
    )
    advice = "".join(f"<li>{escape(line)}</li>" for line in look.advice)
    again = f"<ul>{advice}</ul>" if advice else "<p>Nothing stands out. Go on.</p>"
    others = ", ".join(f"{shown(n)} of {kind}" for kind, n in look.passed_over.items())
    if others:
        again += f"<p>Files that are not read: {escape(others)}.</p>"
    sheets = ""
    if bad:
        sheets += collapsible_section("To look at again", _sheet(bad, thumbs), f"{len(bad)} photographs")
    if good:
        sheets += collapsible_section("Nothing stands out", _sheet(good, thumbs), f"{len(good)} photographs")
    body = (
        f'<header class="top"><p class="eyebrow"><span>photographs <b>{escape(title)}</b></span></p>'
        f'<h1 class="{state}"><span class="mark"></span>{escape(headline)}</h1><dl class="tiles">{tiles}</dl></header>'
        '<main>'
        + section("again", "What to shoot again", "Said of small copies, matched quickly: a model may do better or "
                  "worse.", again)
        + section("photos", "Every photograph", "Sharpness is in percent of the usual one of this set, and shared "
                  "what two or more other photographs show too.", sheets)
        + f"</main><footer><p>{shown(look.pairs)} pairs were compared.</p></footer>"
    )  # fmt: skip
    return whole_page(f"{title} · a look", body)


def _sheet(photos: list[PhotoQuality], thumbs: Mapping[str, bytes]) -> str:
    return f'<div class="sheet">{"".join(_photo(photo, thumbs[photo.name]) for photo in photos)}</div>'


def _photo(photo: PhotoQuality, thumb: bytes) -> str:
    source = data_uri(thumb, "image/jpeg")
    short = photo.faults[0].split(":")[0] if photo.faults else ""
    tag = f'<span class="tag worst">{escape(short)}</span>' if short else ""
    best = (
        f"best with {photo.partners[0][0]} ({shown(photo.partners[0][1])} matches)" if photo.partners else "no partner"
    )
    sharp, shared = fixed(photo.sharpness_pct, 0), fixed(photo.covered_pct, 0)
    said = [
        photo.name,
        f"sharpness {sharp} %",
        f"mean grey {fixed(photo.mean, 0)}",
        f"{fixed(photo.dark_pct, 0)} % black, {fixed(photo.bright_pct, 0)} % white",
        f"{len(photo.partners)} partners, {best}",
        f"{shared} % shared",
        *photo.faults,
    ]
    facts = (
        f"<b>{escape(photo.name)}</b><span>sharp {sharp} %</span>"
        f"<span>{len(photo.partners)} partners</span><span>shared {shared} %</span>"
    )
    words = escape(" · ".join(said), quote=True)
    return (
        f'<button type="button" class="photo{" worst" if photo.faults else ""}" data-facts="{words}">'
        f'<img src="{source}" alt="{escape(photo.name, quote=True)}">{tag}'
        f'<span class="facts">{facts}</span></button>'
    )
