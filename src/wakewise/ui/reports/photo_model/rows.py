"""Rows of the page: facts one below the other, and of tables."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def facts_list(rows: Sequence[tuple[str, str]]) -> str:
    """Names and values, one below the other."""
    return f'<dl class="facts">{"".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in rows)}</dl>'


def table_row(cells: tuple[str, ...], tag: str, kinds: str) -> str:
    """A row of a table: cells of a tag, each text (t), a list (l) or a number set right (r)."""
    classes = {"t": "", "l": "", "r": ' class="num"'}
    inner = [f"<{tag}{classes[k]}>{escape(cell)}</{tag}>" for cell, k in zip(cells, kinds, strict=True)]
    return f"<tr>{''.join(inner)}</tr>"
