"""Pages from Jinja2 templates: the environment, parts that all pages have, and the page as one file.

Templates lie in `templates/`: `base.html` is the frame, `parts.html` holds parts of several pages, and each page has a
file of its own. Templates escape everything but `Markup`; functions here return HTML as plain strings. `page.css` is
the style of all pages; a page contains style and script, so that it opens without a network.

`PageParts` keeps parts of a page that are made before the others.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from wakewise.ui.reports.text import number, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from wakewise.ui.reports.trial import Trial
    from wakewise.ui.reports.views import Viewpoint

_LIGHT, _DARK_WHERE_THE_PAGE_IS = "darkMode:false", "darkMode:matchMedia('(prefers-color-scheme: dark)').matches"
_CODE = re.compile(r"`([^`]+)`")


def prose(text: str) -> Markup:
    """Text as HTML; words between backticks are set as code."""
    return Markup(_CODE.sub(r"<code>\1</code>", str(escape(text))))


@cache
def environment() -> Environment:
    """The Jinja2 environment of all pages, with the filters `prose`, `number` and `shown`."""
    made = Environment(
        loader=PackageLoader("wakewise.ui.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"prose": prose, "number": number, "shown": shown}
    return made


def template(name: str) -> Any:
    """Macros of a template, as functions that return `Markup`."""
    return environment().get_template(name).module


def parts() -> Any:
    """Macros of `parts.html`."""
    return template("parts.html")


def html(sections: Iterable[str]) -> Markup:
    """Strings of HTML as one that templates do not escape."""
    return Markup("").join(map(Markup, sections))


def whole_page(title: str, body: str, *, interactive: bool = True) -> str:
    """One HTML file with style and, if `interactive`, script inside; `body` is HTML."""
    page = environment().get_template("base.html")
    return page.render(title=title, body=Markup(body), interactive=interactive)


def framed_page(title: str, header: str, links: Sequence[tuple[str, str]], sections: Sequence[str], footer: str) -> str:
    """A page of header, links to its sections (anchor, title), sections and footer; all HTML but the title."""
    return whole_page(title, parts().frame(Markup(header), links, html(sections), Markup(footer)))


def section(anchor: str, title: str, lead: str, content: str) -> str:
    """One part of a page; `lead` and `content` are HTML."""
    return str(parts().section(anchor, title, Markup(lead), Markup(content)))


def plot(figure: Figure | None, title: str, caption: str, absent: str = "", narrow: Figure | None = None) -> str:
    """A figure with its caption (HTML), or why there is none; `narrow` is the same figure for a phone."""
    from wakewise.ui.reports.svg_style import inline_svg

    if figure is None:
        return missing(title, absent or "nothing was recorded")
    svg = Markup(inline_svg(figure, str(escape(title))))
    small = "" if narrow is None else Markup(inline_svg(narrow, str(escape(f"{title}, narrow"))))
    return str(parts().plot(svg, small, Markup(caption)))


def missing(what: str, why: str) -> str:
    """A part that cannot be shown, and why."""
    return str(parts().missing(what[:1].upper() + what[1:], prose(why)))


def missing_text(trial: Trial, *needed: str) -> str:
    """Why a view that needs these files of a trial cannot be drawn."""
    gaps = [f"{part} {trial.missing[part]}" for part in needed if part in trial.missing]
    return "; ".join(gaps) or "model and truth do not meet"


def tile(name: str, value: str, unit: str, note: str, state: str = "") -> str:
    """One headline figure; `state` is "ok", "off" or empty."""
    return str(parts().tile(name, value, unit, note, state))


def error_scale(label: str, extras: Sequence[tuple[str, str]] | None = None) -> str:
    """Colour bar of errors in mm; `extras` are colours outside the bar with their labels."""
    from wakewise.ui.reports.svg_style import ERROR_LIMIT_MM, ERROR_STOPS, OVER_LIMIT, css_gradient

    extras = ((OVER_LIMIT, "more"),) if extras is None else extras
    ticks = range(int(ERROR_LIMIT_MM) + 1)
    return str(parts().error_scale(label, css_gradient(ERROR_STOPS), ticks, extras))


def panel(title: str, text: str, aside: str, content: str) -> str:
    """A card with a heading, a line of explanation, and a key on the right; the last two are HTML."""
    return str(parts().panel(title, text, Markup(aside), Markup(content)))


def pictures(sources: Sequence[str], views: Sequence[Viewpoint], what: str) -> str:
    """Views of one thing side by side."""
    named = [(source, f"{what} {view.name}", view.name) for source, view in zip(sources, views, strict=True)]
    return str(parts().views(named))


def scene_box(html: str, legend: str, poster: str = "") -> str:
    """A 3D scene, itself a whole HTML page, in a frame that is filled when it comes into sight.

    `poster`, an image as a data URI, is shown until the scene is drawn.
    """
    html = html.replace(_LIGHT, _DARK_WHERE_THE_PAGE_IS, 1)
    # A JSON string without "<" cannot end the script that holds it.
    store = Markup(json.dumps(html, ensure_ascii=False).replace("<", "\\u003c"))
    return str(parts().scene(store, Markup(legend), poster))


def collapsible_section(title: str, content: str, note: str = "", folded: bool = False) -> str:
    """A part with a heading that can be folded; a phone folds it at first."""
    return str(parts().fold(title, Markup(content), note, folded))


def legend_entry(colour: str, name: str) -> str:
    """One entry of a legend."""
    return str(parts().chip(colour, name))


T = TypeVar("T")


class PageParts:
    """Parts of one page by name, each made once: early if its data are complete, else with the page."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def once(self, name: str, make: Callable[[], T]) -> T:
        """The part of this name, made now if it has not been made."""
        if name not in self._made:
            self._made[name] = make()
        part: T = self._made[name]
        return part
