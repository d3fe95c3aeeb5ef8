"""The diagram of docs/architecture.md as an SVG in the page: its Mermaid text needs a program that is not on a page."""

from __future__ import annotations

import re
from html import escape

WIDTH, ROW, HEIGHT = 640, 46, 26
"""Of the drawing, of a row and of a box, in user units; a character of a name is 7.3 wide."""


def layer_diagram(text: str) -> str:
    """Inline SVG of a Mermaid flowchart of names and arrows: a row for each depth, arrows point down."""
    # api makes reports and ui calls api: of the two arrows the one that points down is drawn.
    edges = [edge for edge in re.findall(r"(\w+) --> (\w+)", text) if edge != ("api", "ui")]
    names = list(dict.fromkeys(re.findall(r"^\s+(\w+)\s*$", text, re.MULTILINE)))
    depth = dict.fromkeys(names, 0)
    for _ in names:
        for above, below in edges:
            depth[below] = max(depth[below], depth[above] + 1)
    rows: dict[int, list[str]] = {}
    for name in names:
        rows.setdefault(depth[name], []).append(name)
    places = {
        name: (WIDTH * (k + 0.5) / len(row), 8 + ROW * d + HEIGHT / 2)
        for d, row in sorted(rows.items())
        for k, name in enumerate(row)
    }
    tall = 16 + ROW * len(rows)
    lines = []
    for above, below in edges:
        (x0, y0), (x1, y1) = places[above], places[below]
        y0, y1 = y0 + HEIGHT / 2, y1 - HEIGHT / 2 - 3
        bend = 0.5 * min(y1 - y0, 2 * ROW)
        lines.append(
            f'<path d="M{x0:.0f} {y0:.0f} C{x0:.0f} {y0 + bend:.0f} {x1:.0f} {y1 - bend:.0f} {x1:.0f} {y1:.0f}"/>'
        )
    boxes = []
    for name, (x, y) in places.items():
        half = 0.5 * (7.3 * len(name) + 18)
        boxes.append(
            f'<rect x="{x - half:.0f}" y="{y - HEIGHT / 2:.0f}" width="{2 * half:.0f}" height="{HEIGHT}" rx="4"/>'
            f'<text x="{x:.0f}" y="{y + 4:.0f}">{escape(name)}</text>'
        )
    return (
        f'<div class="layer-diagram"><svg viewBox="0 0 {WIDTH} {tall}" role="img" '
        'aria-label="Packages: an arrow points from a package to one that it imports">'
        '<defs><marker id="tip" viewBox="0 0 6 6" refX="5" refY="3" markerWidth="6" markerHeight="6" orient="auto">'
        f'<path d="M0 0 L6 3 L0 6 z"/></marker></defs><g class="arrows">{"".join(lines)}</g>'
        f'<g class="boxes">{"".join(boxes)}</g></svg></div>\n'
    )
