"""Draw the reference hardware and write its tables: tools/hardware.yaml into docs/images/*.svg and docs/hardware.md.

A test fails when either is stale, or when a rate is not what the code has.
"""

from __future__ import annotations

from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

HERE = Path(__file__).parent
DOCS = HERE.parent / "docs"
WIDTH = 1000
_STYLE = """
text { font: 14px system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif; fill: #1b2733; }
.page { fill: #ffffff; }
.area { fill: #f2f6f9; stroke: none; }
.name { font-size: 13px; fill: #5b6b7a; letter-spacing: .06em; }
.box { fill: #ffffff; stroke: #8195a6; stroke-width: 1.5; }
.ours { fill: #e0f4f1; stroke: #0b7a6b; stroke-width: 2; }
.title { font-weight: 600; }
.small { font-size: 12.5px; fill: #44535f; }
.data { stroke: #2563a8; stroke-width: 1.8; fill: none; }
.power { stroke: #b4540a; stroke-width: 2.6; fill: none; }
.tip-data { fill: #2563a8; } .tip-power { fill: #b4540a; }
.label { font-size: 12.5px; fill: #1b2733; }
.rate { font-size: 12.5px; fill: #2563a8; font-weight: 600; }
@media (prefers-color-scheme: dark) {
  text, .label { fill: #e3eaf0; } .page { fill: #10181f; } .area { fill: #18232c; } .name { fill: #93a4b3; }
  .box { fill: #22303b; stroke: #6f8597; } .ours { fill: #123c37; stroke: #35c2ac; } .small { fill: #b6c3ce; }
  .data { stroke: #6fb1f5; } .power { stroke: #f0994d; } .tip-data { fill: #6fb1f5; } .tip-power { fill: #f0994d; }
  .rate { fill: #8fc4fa; }
}
"""


def read_table() -> dict[str, Any]:
    """The drawings, as the file has them."""
    table: dict[str, Any] = yaml.safe_load((HERE / "hardware.yaml").read_text(encoding="utf-8"))["drawings"]
    return table


def value_of(constant: str) -> float:
    """What the code has: `module:name`, `module:Class.field` for a default, `1/...` or `1000/...` for a period."""
    over, _, rest = constant.rpartition("/")
    module, _, name = rest.partition(":")
    thing: Any = import_module(module)
    for part in name.split("."):
        fields = getattr(thing, "model_fields", {})
        thing = fields[part].default if part in fields else getattr(thing, part)
    return float(over) / float(thing) if over else float(thing)


def drawing(told: dict[str, Any]) -> str:
    """One drawing as SVG."""
    height = told["height"]
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        f'role="img" aria-label="{escape(told["title"])}: boxes and the links between them">',
        f"<style>{_STYLE}</style>",
        '<defs><marker id="data" markerWidth="9" markerHeight="8" refX="8" refY="4" orient="auto">'
        '<path class="tip-data" d="M0,0 L9,4 L0,8 z"/></marker>'
        '<marker id="power" markerWidth="7" markerHeight="6" refX="6" refY="3" orient="auto">'
        '<path class="tip-power" d="M0,0 L7,3 L0,6 z"/></marker></defs>',
        f'<rect class="page" width="{WIDTH}" height="{height}" rx="10"/>',
    ]
    for area in told["areas"]:
        parts.append(f'<rect class="area" x="8" y="{area["y"]}" width="{WIDTH - 16}" height="{area["h"]}" rx="8"/>')
        parts.append(f'<text class="name" x="20" y="{area["y"] + 20}">{escape(area["title"])}</text>')
    boxes = told["boxes"]
    parts += [_link(link, boxes[link["from"]], boxes[link["to"]]) for link in told["links"]]
    parts += [_box(box) for box in boxes.values()]
    return "\n".join([*parts, "</svg>", ""])


def _box(box: dict[str, Any]) -> str:
    kind = "box ours" if box.get("ours") else "box"
    middle = box["x"] + box["w"] / 2
    lines = box["lines"]
    top = box["y"] + box["h"] / 2 - 8.5 * len(lines) + 5
    parts = [f'<rect class="{kind}" x="{box["x"]}" y="{box["y"]}" width="{box["w"]}" height="{box["h"]}" rx="6"/>']
    for k, line in enumerate([box["title"], *lines]):
        style = "small" if k else "title"
        parts.append(
            f'<text class="{style}" x="{middle:g}" y="{top + 17 * k:g}" text-anchor="middle">{escape(str(line))}</text>'
        )
    return "\n".join(parts)


def _link(link: dict[str, Any], a: dict[str, Any], b: dict[str, Any]) -> str:
    kind = link.get("kind", "data")
    if link.get("bend"):
        x, y0, y1 = a["x"] + a["w"] / 2, a["y"] + a["h"], b["y"] + b["h"] / 2
        path = f"M{x:g},{y0} L{x:g},{y1:g} L{b['x'] + b['w'] + 2},{y1:g}"
        place, side = (x - 10, (y0 + y1) / 2), "end"
    elif a["y"] + a["h"] <= b["y"] or b["y"] + b["h"] <= a["y"]:
        down = a["y"] < b["y"]
        y0, y1 = (a["y"] + a["h"], b["y"]) if down else (a["y"], b["y"] + b["h"])
        x = link.get("at", a["x"] + a["w"] / 2)
        path = f"M{x:g},{y0} L{x:g},{y1 - 2 if down else y1 + 2}"
        place, side = (x + 9, (y0 + y1) / 2 - 4), "start"
    else:
        right = a["x"] < b["x"]
        x0, x1 = (a["x"] + a["w"], b["x"]) if right else (a["x"], b["x"] + b["w"])
        y = link.get("at", max(a["y"], b["y"]) + min(a["h"], b["h"]) / 2)
        path = f"M{x0},{y:g} L{x1 - 2 if right else x1 + 2},{y:g}"
        place, side = ((x0 + x1) / 2, y - 7 if kind == "power" else y - 6), "middle"
    text = [f'<path class="{kind}" d="{path}" marker-end="url(#{kind})"/>']
    label = [("label", link["carries"])] + ([("rate", rate_of(link))] if "rate" in link else [])
    below = [0, 23] if side == "middle" else [0, 16]
    for (style, words), y in zip(label, below, strict=False):
        text.append(
            f'<text class="{style}" x="{place[0]:g}" y="{place[1] + y:g}" text-anchor="{side}">{escape(words)}</text>'
        )
    return "\n".join(text)


def rate_of(link: dict[str, Any]) -> str:
    """A rate in words."""
    return f"{link['rate']:g} {link['unit']}"


def table_of(told: dict[str, Any]) -> str:
    """All links of a drawing that have a rate, as Markdown."""
    rows = ["| from | to | what | rate | where the figure comes from |", "|---|---|---|---|---|"]
    for link in told["links"]:
        if "rate" not in link:
            continue
        a, b = (told["boxes"][link[end]]["title"].removesuffix(" *") for end in ("from", "to"))
        constant = f"; `{link['constant'].rpartition('/')[2].removeprefix('wakewise.')}`" if "constant" in link else ""
        rows.append(f"| {a} | {b} | {link['carries']} | {rate_of(link)} | {link['source']}{constant} |")
    return "\n".join(rows)


def page(text: str, table: dict[str, Any]) -> str:
    """docs/hardware.md with its tables filled in anew."""
    for name, told in table.items():
        begin, end = f"<!-- rates of {name} -->", "<!-- end -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not found or not closed:
            raise SystemExit(f"docs/hardware.md: must have '{begin}' and then '{end}'")
        text = f"{before}{begin}\n{table_of(told)}\n{end}{after}"
    return text


def pages() -> dict[str, str]:
    """Every file that is made, by its path below docs/."""
    table = read_table()
    made = {f"images/hardware-{name}.svg": drawing(told) for name, told in table.items()}
    made["hardware.md"] = page((DOCS / "hardware.md").read_text(encoding="utf-8"), table)
    return made


if __name__ == "__main__":
    for path, content in pages().items():
        (DOCS / path).write_text(content, encoding="utf-8")
        print(f"wrote docs/{path}")
