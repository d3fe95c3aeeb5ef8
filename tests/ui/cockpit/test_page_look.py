"""The page is legible and whole at every size: Stop in reach, names on buttons, contrast, nothing from elsewhere."""

from __future__ import annotations

import re
from typing import Any

import pytest
from standin import PAGE, SHARED, StandIn

SIZES = {
    "desktop": (1280, 800, False),
    "upright": (390, 844, True),
    "sideways": (844, 390, True),
    "tablet": (900, 1100, True),
}
AT_MIDDLE = """(() => {
  const b = document.getElementById('stop').getBoundingClientRect();
  return Boolean(document.elementFromPoint(b.x + b.width / 2, b.y + b.height / 2)?.closest('#stop'))
    && b.left >= 0 && b.top >= 0 && b.right <= innerWidth && b.bottom <= innerHeight
    && b.width > 60 && b.height > 34; })()"""
NAMELESS = """[...document.querySelectorAll('button, input, canvas, svg[role], iframe')].filter((e) => !(e.hidden ||
  e.getAttribute('aria-hidden') || e.textContent?.trim() || e.getAttribute('aria-label') || e.title
  || e.labels?.length)).map((e) => e.outerHTML)"""


SMALL = """[...document.querySelectorAll('body *')].filter((e) => e.offsetParent !== null
  && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())
  && parseFloat(getComputedStyle(e).fontSize) < 12).map((e) => e.outerHTML)"""
LOW = """[...document.querySelectorAll('button, input')].filter((e) => { const b = e.getBoundingClientRect();
  return b.width > 0 && (b.height < 44 || (e.matches('button') && b.width < 44)); }).map((e) => e.outerHTML)"""
HIDDEN = """[...document.querySelectorAll('.side .panel')].filter((e) => e.offsetParent !== null
  && e.scrollHeight > e.clientHeight + 1).map((e) => e.className)"""


@pytest.mark.parametrize("size", SIZES)
def test_words_can_be_read_and_thumbs_find_every_button(standin: StandIn, spectate: Any, size: str) -> None:
    """No text below 12 px; on a phone every button and slider is 44 px high, and no panel hides a part of itself."""
    width, height, phone = SIZES[size]
    page = spectate("", width, height, phone=phone)
    tabs = page.js(
        "[...document.querySelectorAll('[data-show]')].filter((e) => e.offsetParent).map((e) => e.dataset.show)"
    )
    assert bool(tabs) == (size == "upright")
    for tab in tabs or [None]:
        if tab is not None:
            page.click(f"[data-show={tab}]")
        assert page.js(SMALL) == []
        if size in ("upright", "sideways"):
            assert page.js(LOW) == []
            assert page.js(HIDDEN) == []
    for box in ("help", "end"):
        page.click(f"#{box}")
        assert page.js(SMALL) == []
        assert size in ("desktop", "tablet") or page.js(LOW) == []
        page.js(f"document.getElementById('{box}-box').close()")


@pytest.mark.parametrize("size", SIZES)
def test_stop_is_in_reach_and_nothing_runs_over(standin: StandIn, spectate: Any, size: str) -> None:
    """On a desktop, on a phone held either way, on a tablet: with and without the helm, and as a widget."""
    width, height, phone = SIZES[size]
    page = spectate("", width, height, phone=phone)
    for helm in ("free", "mine"):
        assert page.js("document.body.dataset.helm") == helm
        assert page.js(AT_MIDDLE)
        assert page.js("document.documentElement.scrollWidth <= innerWidth && document.body.scrollWidth <= innerWidth")
        page.press("KeyG")
        page.until("document.body.dataset.helm === 'mine' || document.body.dataset.helm === 'free'")
        page.until(f"document.body.dataset.helm === '{'mine' if helm == 'free' else 'free'}'")
    assert page.js(NAMELESS) == []
    page.go(standin.url + "?widget=1")
    page.until("document.body.dataset.link === 'up'")
    assert page.js(AT_MIDDLE)


def test_nothing_comes_from_elsewhere(standin: StandIn, spectate: Any) -> None:
    """Every file that the browser fetched is this server's; no file of the page names another host."""
    page = spectate()
    fetched = page.js("performance.getEntriesByType('resource').map((e) => e.name)")
    assert len(fetched) > 15
    assert all(name.startswith(standin.url) for name in fetched)
    for entry in [*PAGE.iterdir(), *SHARED.iterdir()]:
        text = entry.read_text(encoding="utf-8").replace('xmlns="http://www.w3.org/2000/svg"', "")
        assert not re.search(r"https?://|//[a-z]+\.[a-z]+/|\beval\(|innerHTML = [^\"]", text), entry.name
        assert not re.search(r"\sstyle=|\son[a-z]+=\"|<script>", text), f"{entry.name}: a policy without inline code"
        assert len(text.splitlines()) <= 400


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_words_stand_out(theme: str) -> None:
    """At least 4.5 to 1, as WCAG 2.2 (1.4.3) asks of small text, in both themes."""
    css = (SHARED / "colours.css").read_text(encoding="utf-8")
    start = css.index(":root {") if theme == "light" else css.index(':root[data-theme="dark"]')
    inks = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", css[start : css.index("}", start)]))
    for ink, ground in (
        ("ink", "paper"), ("ink", "card"), ("ink", "soft"), ("muted", "paper"), ("muted", "card"), ("accent", "card"),
        ("on-accent", "accent"), ("good", "card"), ("bad", "card"), ("bad", "bad-soft"), ("warn", "card"),
        ("ink", "good-soft"), ("muted", "good-soft"), ("muted", "warn-soft"), ("muted", "bad-soft"),
    ):  # fmt: skip
        assert contrast(inks[ink], inks[ground]) >= 4.5, (ink, ground, contrast(inks[ink], inks[ground]))
    assert contrast("#ffffff", inks["stop"]) >= 4.5


def contrast(one: str, other: str) -> float:
    """Ratio of relative luminances, 1 to 21."""
    low, high = sorted(luminance(colour) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def test_wash_is_told_as_a_speed(standin: StandIn, spectate: Any) -> None:
    """Root mean square over the target, in mm/s, as the wash meter has it; what is not known is a dash."""
    page = spectate()
    page.until("/^\\d+\\.\\d+.mm.s$/.test(document.querySelector('[data-field=rms]').innerText)")
    standin.quiet = True
    standin.tell({**standin.state(), "rms_m_s": 0.0123, "saved_pct": None})
    page.until("document.querySelector('[data-field=rms]').innerText.startsWith('12.3')")
    assert page.text("[data-field=saved]") == "–"
    assert "mm²" not in page.js("document.body.textContent")


def luminance(colour: str) -> float:
    """Relative luminance, 0 to 1, of "#rrggbb" (WCAG 2.2)."""
    red, green, blue = (linear(int(colour[i : i + 2], 16) / 255) for i in (1, 3, 5))
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def linear(channel: float) -> float:
    return channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4
