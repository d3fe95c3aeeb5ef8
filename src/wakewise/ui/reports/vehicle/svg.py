"""Elements of an SVG drawing as text."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

INK, MUTED = "#16232e", "#5b6b7a"


def tag(name: str, content: str | None = None, **attributes: str | float | None) -> str:
    """One element; lengths in pixels are rounded to 0.1, text is escaped.

    Underscores in names of attributes stand for hyphens; an attribute that is None is left out.
    """
    values = {key.replace("_", "-"): value for key, value in attributes.items() if value is not None}
    shown = "".join(f' {key}="{f"{v:.1f}" if isinstance(v, float) else escape(str(v))}"' for key, v in values.items())
    return f"<{name}{shown}/>" if content is None else f"<{name}{shown}>{escape(content)}</{name}>"


def text(
    x: float, y: float, words: str, *, colour: str = INK, size: int = 12, weight: int = 400, anchor: str = "start"
) -> str:
    """One line of text."""
    return tag(
        "text", words, x=float(x), y=float(y), fill=colour, font_size=size, font_weight=weight, text_anchor=anchor
    )


def svg_page(width: float, height: float, title: str, parts: Iterable[str]) -> str:
    """Parts on a white page as one self-contained SVG."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'font-family="system-ui, -apple-system, Segoe UI, Roboto, sans-serif" font-size="12" fill="{INK}">'
    )
    paper = tag("rect", width=round(width), height=round(height), fill="#ffffff")
    return "\n".join([head, tag("title", title), paper, *parts, "</svg>"]) + "\n"
