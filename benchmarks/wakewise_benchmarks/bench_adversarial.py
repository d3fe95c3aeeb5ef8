"""What `wakewise bench traps` prints: a row a trap, and how many were silent."""

from __future__ import annotations

from typing import Any

import typer

from wakewise.ui.cli.console import format_value


def show_traps(result: dict[str, Any]) -> None:
    """A row per trap: verdict, photographs with a place, error of the cameras, and what was said."""
    for name, row in result["traps"].items():
        placed = f"{row['registered']} of {row['photos']}"
        off = "" if row["off_pct"] is None else f"{format_value(row['off_pct'])} %"
        typer.echo(f"  {name:<20}{row['verdict']:<8}{placed:>9}{off:>9}  {row['why']}")
        for words in row["said"]:
            typer.echo(f"  {'':<20}  {words}")
    typer.echo(f"  right {result['right']}, said {result['said']}, silently wrong {result['silent_wrongs']}")
