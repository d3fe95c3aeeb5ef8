"""Pieces of HTML that a report is put together from, and the frame around them.

Parts of a page that are made before the others, while what the others show is still being made.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from html import escape
from importlib import resources
from string import Template
from typing import Any, TypeVar

from matplotlib.figure import Figure

from wakewise.ui.reports.svg_style import ERROR_LIMIT_MM, ERROR_STOPS, OVER_LIMIT, css_gradient, inline_svg
from wakewise.ui.reports.trial import Trial
from wakewise.ui.reports.views import Viewpoint

_LIGHT, _DARK_WHERE_THE_PAGE_IS = "darkMode:false", "darkMode:matchMedia('(prefers-color-scheme: dark)').matches"
_CODE = re.compile(r"`([^`]+)`")


def whole_page(title: str, body: str) -> str:
    """One HTML file with style and script inside."""
    package = resources.files("wakewise.ui.reports")
    text = {name: package.joinpath(name).read_text(encoding="utf-8") for name in ("page.html", "page.css", "page.js")}
    return Template(text["page.html"]).substitute(
        title=escape(title), style=text["page.css"], script=text["page.js"], body=body
    )


def section(anchor: str, title: str, lead: str, content: str) -> str:
    """One part of the page; `lead` says in a sentence or two what is to be seen."""
    return f'<section id="{anchor}"><h2>{escape(title)}</h2><p class="lead">{lead}</p>{content}</section>'


def plot(figure: Figure | None, title: str, caption: str, absent: str = "", narrow: Figure | None = None) -> str:
    """A figure with its caption, or a note why there is none; `narrow` is the same drawn for a phone."""
    if figure is None:
        return missing(title, absent or "nothing was recorded")
    svg = inline_svg(figure, escape(title, quote=True))
    if narrow is not None:
        small = inline_svg(narrow, escape(f"{title}, narrow", quote=True))
        svg = f'<div class="wide-only">{svg}</div><div class="narrow-only">{small}</div>'
    return f'<figure class="plot">{svg}<figcaption>{caption}</figcaption></figure>'


def prose(text: str) -> str:
    """Words as HTML: what is code between backticks is set as code."""
    return _CODE.sub(r"<code>\1</code>", escape(text))


def missing(what: str, why: str) -> str:
    """An honest gap."""
    return f'<p class="missing"><b>{escape(what[:1].upper() + what[1:])}</b> cannot be shown: {prose(why)}.</p>'


def missing_text(trial: Trial, *parts: str) -> str:
    """Why a view that needs these files of a trial cannot be drawn."""
    gaps = [f"{part} {trial.missing[part]}" for part in parts if part in trial.missing]
    return "; ".join(gaps) or "model and truth do not meet"


def tile(name: str, value: str, unit: str, note: str, state: str = "") -> str:
    """One headline figure; `state` is "ok", "off" or empty."""
    small = f"<small>{escape(unit)}</small>" if unit else ""
    return (
        f'<div class="{state}"><dt>{escape(name)}</dt><dd class="value">{escape(value)}{small}</dd>'
        f'<dd class="note">{escape(note)}</dd></div>'
    )


def error_scale(label: str, extras: Sequence[tuple[str, str]] = ((OVER_LIMIT, "more"),)) -> str:
    """Colour bar of errors in mm, as HTML; `extras` are colours outside the bar with their labels."""
    ticks = "".join(f"<span>{tick}</span>" for tick in range(int(ERROR_LIMIT_MM) + 1))
    more = "".join(f'<span class="extra"><i style="background:{c}"></i>{escape(n)}</span>' for c, n in extras)
    return (
        f'<span class="scale"><span>{escape(label)}</span>'
        f'<span class="bar"><i style="background:{css_gradient(ERROR_STOPS)}"></i>'
        f'<span class="ticks">{ticks}</span></span>'
        f'<span class="extras">{more}</span></span>'
    )


def panel(title: str, text: str, aside: str, content: str) -> str:
    """A card with a heading, a line of explanation and a key on the right."""
    return (
        f'<div class="panel"><header><div><h3>{escape(title)}</h3><p>{escape(text)}</p></div>{aside}</header>'
        f"{content}</div>"
    )


def pictures(sources: Sequence[str], views: Sequence[Viewpoint], what: str) -> str:
    """Views of one thing side by side."""
    return '<div class="views">' + "".join(
        f'<figure><img alt="{escape(what)} {view.name}" src="{source}"><figcaption>{view.name}</figcaption></figure>'
        for source, view in zip(sources, views, strict=True)
    ) + "</div>"  # fmt: skip


def scene_box(html: str, legend: str, poster: str = "") -> str:
    """A 3D scene, itself a whole HTML page, in a frame that is filled when it comes into sight.

    Until it has drawn itself, and where it cannot, `poster` stands in its place: an image as a data URI.
    """
    html = html.replace(_LIGHT, _DARK_WHERE_THE_PAGE_IS, 1)
    # A JSON string without "<" cannot end the script that holds it.
    store = json.dumps(html, ensure_ascii=False).replace("<", "\\u003c")
    still = f'<img alt="the model" src="{poster}">' if poster else ""
    return (
        f'<div class="scene"><div class="stage"><div class="poster">{still}<p>The 3D scene is loading …</p></div>'
        '<iframe title="3D scene of the model and the flight" allow="fullscreen"></iframe></div>'
        f'<script type="application/json">{store}</script><div class="legend">{legend}</div></div>'
    )


def collapsible_section(title: str, content: str, note: str = "", folded: bool = False) -> str:
    """A part with a heading that can be folded; a phone folds it at first."""
    aside = f"<span>{escape(note)}</span>" if note else ""
    way = "" if folded else " open"
    return f'<details class="fold"{way}><summary>{escape(title)}{aside}</summary>{content}</details>'


def legend_entry(colour: str, name: str) -> str:
    """One entry of a legend."""
    return f'<span class="chip"><i style="background:{colour}"></i>{escape(name)}</span>'


T = TypeVar("T")


class PageParts:
    """Keeps each part of a page by name, so that it is made once: early if that can be, else with the page.

    A draft belongs to one page. Whoever asks for a part before the page is written must know that nothing which the
    part shows is still to come.
    """

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def once(self, name: str, make: Callable[[], T]) -> T:
        """The part of this name, made now if it has not been made."""
        if name not in self._made:
            self._made[name] = make()
        part: T = self._made[name]
        return part
