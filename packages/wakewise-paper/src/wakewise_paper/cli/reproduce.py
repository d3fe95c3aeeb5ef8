"""`wakewise reproduce`: the paper's tables beside ours."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.core.checks import counted
from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, print_json, print_table, write_page
from wakewise.ui.cli.options import Json

_UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}


def reproduce(
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="TABLE",
            help="dynamic, success, station, ablation, sediment, flow, solver, wake, field, operator, comparison, or "
            "all.",
        ),
    ],
    trials: Annotated[
        int | None,
        typer.Option(
            help="Seeds for each target, a third of them beside the paper's own world; 1 without --trials and --budget."
        ),
    ] = None,
    first_seed: Annotated[int, typer.Option(help="First seed; others than 3001 are for trying things.", min=0)] = 3001,
    budget: Annotated[
        str | None, typer.Option(help="Time for all of it, such as 30min, 2h or 90s: as many trials as fit.")
    ] = None,
    worlds: Annotated[
        str | None,
        typer.Option(
            "--world",
            help="Where trials are made, with commas between: worlds of the library (`wakewise world list`), paper "
            "(its own wake as the water: circular), lattice, caco3, field; each table's own if not given.",
        ),
    ] = None,
    methods: Annotated[
        str | None, typer.Option(help="Only these, with commas between; each table's own if not given.")
    ] = None,
    targets: Annotated[
        str | None, typer.Option(help="In place of the tables' own, with commas between; any target.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Only so many seconds of each flight, to try it; scans are whole.", min=1.0)
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for results.json and the page (or pages).")] = Path(
        "runs/reproduce"
    ),
    store: Annotated[Path, typer.Option(help="Folder that keeps the trials, of all calls together.")] = Path(
        "runs/reproduce-trials"
    ),
    workers: Annotated[int, typer.Option(help="Trials at a time.", min=1, max=1024)] = 2,
    again: Annotated[bool, typer.Option("--again", help="Try trials anew that failed in an earlier run.")] = False,
    markdown: Annotated[
        bool,
        typer.Option("--markdown", help="Write Markdown pages and small plots in place of the page with pictures."),
    ] = False,
    json: Json = False,
) -> None:
    """Make the paper's tables from trials of our own: paper, ours, interval, met or not.

    What is finished is kept: the same command goes on where it was stopped, and more --trials only adds what is new.
    A flight takes 5 to 20 s of a core, one of 180 s about a minute, a whole scan with its model two minutes.
    """
    from wakewise.core.optional_dependencies import need
    from wakewise_paper.reproduction.claim import TABLES
    from wakewise_paper.reproduction.run import ReproduceOptions

    need("wakewise reproduce", "photos", "reports", "logs")
    chosen = list(TABLES) if "all" in names else list(dict.fromkeys(names))
    for name in chosen:
        if name not in TABLES:
            raise InputError(f"table '{name}': not known, allowed: {', '.join(TABLES)}, all")
    with ProgressBars().stage("reproduce") as progress:
        from wakewise_paper.reproduction.run import reproduce as run

        tables = run(
            chosen,
            store,
            ReproduceOptions(
                trials=trials,
                first_seed=first_seed,
                budget_s=None if budget is None else seconds("--budget", budget),
                worlds=_listed(worlds),
                methods=_listed(methods),
                targets=_listed(targets),
                duration_s=duration,
                workers=workers,
                again=again,
                progress=progress,
            ),
        )
    pages: list[Path] = []
    _keep(tables, out)
    write_page("page", lambda: pages.append(_write(tables, store, out, markdown)))
    if json:
        told = {name: _told(table) for name, table in tables.items()}
        print_json(told[chosen[0]] if len(chosen) == 1 else {"tables": told})
        return
    for table in tables.values():
        show_table(table)
    for page in pages:
        typer.echo(f"page: {page}")


def seconds(option: str, text: str) -> float:
    """Seconds of a time such as 30min.

    Raises
    ------
    InputError
        If it is none.
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|m|h)?\s*", text)
    if found is None or float(found[1]) <= 0.0:
        raise InputError(f"{option} '{text}': must be a time such as 30min, 2h or 90s")
    return float(found[1]) * _UNITS[found[2] or "s"]


def show_table(table: dict[str, Any]) -> None:
    """Rows as people read them: paper, ours, interval, met or not."""
    from wakewise_paper.reports.reproduction import sentences

    made = f"{counted(table['made'], 'trial')}, {table['failed']} failed" if table["made"] else "not made"
    columns = ("world", "method", "target", "figure", "paper", "ours", "95 %", "n", "verdict")
    rows = [
        (
            row["world"],
            row["method"],
            row["target"] or "all",
            row["figure"],
            sentences.quoted(row),
            row.get("our_order") or sentences.our_value(row),
            sentences.interval(row),
            row["n"],
            sentences.verdict(row),
        )
        for row in table["rows"]
    ]
    print_table("ttttnnnnt", columns, rows, f"{table['table']}: {table['title']} ({made})")
    if table["rows"]:
        typer.echo(sentences.met_of({table["table"]: table["rows"]}))
    for failure in table["failures"]:
        typer.echo(f"failed: {failure['trial']}: {failure['reason']}")
    if table["left_undone"]:
        typer.echo(f"{counted(table['left_undone'], 'trial')} had no room in the budget; the same command goes on")
    for reason in table["why"].values():
        typer.echo(reason)


def _told(table: dict[str, Any]) -> dict[str, Any]:
    """What is printed as JSON: all but where the pictures lie."""
    first = ("rows", "trials", "seeds", "config_hash")
    return {key: table[key] for key in first} | {
        key: value for key, value in table.items() if key not in (*first, "places")
    }


def _keep(tables: dict[str, dict[str, Any]], out: Path) -> None:
    from wakewise.core.files import write_json

    write_json(out / "results.json", {"tables": {name: _told(table) for name, table in tables.items()}})


def _write(tables: dict[str, dict[str, Any]], store: Path, out: Path, markdown: bool) -> Path:
    from wakewise_paper.reports.reproduction import write_pages, write_results

    return write_results(tables, store, out) if markdown else write_pages(tables, store, out)


def _listed(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(";" if ";" in text else ",") if name.strip())
    if not names:
        raise InputError("a list with nothing in it: must be names with commas between")
    return names
