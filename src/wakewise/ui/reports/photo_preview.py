"""The page of a look at photographs: what to shoot again, then every photograph with what was seen of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from markupsafe import Markup

from wakewise.core.files import write_text
from wakewise.ui.reports.page import collapsible_section, framed_page, parts, section, template, tile
from wakewise.ui.reports.svg_style import data_uri
from wakewise.ui.reports.text import fixed, shown
from wakewise.vision.reconstruction.quality.photo_preview import PhotoPreview, PhotoQuality

MOST_BAD = 0.1
"""Share of the photographs to look at again up to which a dive is fair, and not bad."""


def write_look(look: PhotoPreview, thumbs: Mapping[str, bytes], path: Path, title: str) -> None:
    """Write the preview as one HTML file that opens without a network; `thumbs` are JPEG bytes by photo name."""
    write_text(path, look_page(look, thumbs, title))


def look_page(look: PhotoPreview, thumbs: Mapping[str, bytes], title: str) -> str:
    """HTML of the preview."""
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
    tiles = [
        tile("photographs", str(count), "", f"{shown(first.width)} x {shown(first.height)} px"),
        tile("hang together", shown(together), f"of {count}", "by their overlap", "ok" if whole else "off"),
        tile("partners each", str(partners), "", "photos that overlap it, median", "ok" if partners >= 4 else "off"),
        tile("covered", fixed(covered, 0), "%", "of a photo is in two others, median"),
        tile("blurred", str(blurred), "", "of them", "ok" if blurred == 0 else "off"),
        tile("light", str(light), "", "too dark or burnt out", "ok" if light == 0 else "off"),
    ]
    macros = template("photos.html")
    sheets = ""
    for name, photos in (("To look at again", bad), ("Nothing stands out", good)):
        if photos:
            sheet = parts().sheet([_photo(photo, thumbs[photo.name]) for photo in photos])
            sheets += collapsible_section(name, sheet, f"{len(photos)} photographs")
    others = ", ".join(f"{shown(n)} of {kind}" for kind, n in look.passed_over.items())
    again_lead = "Said of small copies, matched quickly: a model may do better or worse."
    photos_lead = (
        "Sharpness is in percent of the usual one of this set, and shared what two or more other photographs show too."
    )
    sections = (
        section("again", "What to shoot again", again_lead, macros.advice(look.advice, others)),
        section("photos", "Every photograph", photos_lead, sheets),
    )
    header = parts().header([("photographs", title)], headline, state, tiles=[Markup(one) for one in tiles])
    return framed_page(f"{title} · a look", header, (), sections, macros.preview_footer(shown(look.pairs)))


def _photo(photo: PhotoQuality, thumb: bytes) -> Markup:
    tag = photo.faults[0].split(":")[0] if photo.faults else ""
    best = (
        f"best with {photo.partners[0][0]} ({shown(photo.partners[0][1])} matches)" if photo.partners else "no partner"
    )
    sharp, shared = fixed(photo.sharpness_pct, 0), fixed(photo.covered_pct, 0)
    facts = [
        photo.name,
        f"sharpness {sharp} %",
        f"mean grey {fixed(photo.mean, 0)}",
        f"{fixed(photo.dark_pct, 0)} % black, {fixed(photo.bright_pct, 0)} % white",
        f"{len(photo.partners)} partners, {best}",
        f"{shared} % shared",
        *photo.faults,
    ]
    details = template("photos.html").preview_details(photo, sharp, shared)
    source, kind = data_uri(thumb, "image/jpeg"), "worst" if tag else ""
    made: Markup = parts().photo(source, photo.name, " · ".join(facts), kind, tag, details)
    return made
