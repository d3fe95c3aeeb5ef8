"""What a person sees: a bar per stage with time left on standard error, tables or JSON on standard output.

Rich is imported when something is drawn, since every command imports this page and `--help` is to be quick.
"""

from __future__ import annotations

import json
import math
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import typer

from wakewise.ui.cli.signals import INTERRUPTED

if TYPE_CHECKING:
    from rich.console import Console


HEARTBEAT_S = 30.0
"""Longest silence of a stage whose progress goes into a pipe or a file."""


_QUIET = ContextVar("quiet", default=False)


@contextmanager
def quiet_progress(quiet: bool = True) -> Iterator[None]:
    """Show no progress of stages while the block runs, if `quiet`; results, warnings and errors are shown."""
    token = _QUIET.set(quiet)
    try:
        yield
    finally:
        _QUIET.reset(token)


@cache
def _stderr() -> Console:
    from rich.console import Console

    return Console(stderr=True, highlight=False)


class ProgressBars:
    """A `Watch` that shows a progress bar while a stage runs and leaves one line behind it.

    Where standard error is no terminal that line is written, and one now and then before it, so that a log shows life.
    A stage that fails leaves nothing more: the error speaks.
    """

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[..., None]]:
        """Show a bar while the block runs."""
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        stderr = _stderr()
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description:<12}"),
            BarColumn(bar_width=30),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("[dim]{task.fields[note]}"),
        )
        began, quiet = time.perf_counter(), _QUIET.get()
        with Progress(*columns, console=stderr, transient=True, disable=quiet or not stderr.is_terminal) as progress:
            task = progress.add_task(name, total=None, note="")

            def advance(done: float, total: float, note: str = "") -> None:
                if INTERRUPTED.is_set():
                    raise KeyboardInterrupt
                progress.update(task, completed=done, total=total, note=note)
                where[:] = [done, total, note]

            where: list[Any] = [0, 0, ""]
            with nullcontext() if quiet or stderr.is_terminal else _heartbeat(name, where):
                yield advance
        took_s = round(time.perf_counter() - began)
        if not quiet:
            stderr.print(f"[green]✓[/] {name:<12} {took_s // 60:>3}:{took_s % 60:02} min")

    def skipped(self, name: str) -> None:
        """Say that a stage was already done."""
        if not _QUIET.get():
            _stderr().print(f"[green]✓[/] {name:<12} [dim]already done")


@contextmanager
def _heartbeat(name: str, where: list[Any]) -> Iterator[None]:
    """Write where a stage is (done, total, note) to standard error every half minute while the block runs.

    By a thread of its own, as the work may not speak for longer than that.
    """
    over = threading.Event()
    began = time.perf_counter()

    def beat() -> None:
        while not over.wait(HEARTBEAT_S):
            done, total, note = where
            took_s = round(time.perf_counter() - began)
            told = (f" {100.0 * done / total:.0f} %" if total else "") + (f" {note}" if note else "")
            with suppress(OSError, ValueError):  # nobody reads on
                _stderr().print(f"  {name}{told}, {took_s // 60}:{took_s % 60:02} min", markup=False)

    thread = threading.Thread(target=beat, name="heartbeat", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def write_page(name: str, write: Callable[[], Any]) -> bool:
    """Write a report beside a result, as a stage of this name; whether it came about.

    A report that fails is told in one line, and costs neither the result nor the exit code.
    """
    from wakewise.experiments.trials.stages import report_attempt

    with report_attempt() as attempt, ProgressBars().stage(name):
        write()
    if INTERRUPTED.is_set():
        raise KeyboardInterrupt
    return no_report(attempt.fault)


def no_report(fault: str | None) -> bool:
    """Say on standard error why there is no report; whether there is one, which is where no fault is given."""
    if fault is not None:
        print(f"wakewise: report could not be written: {fault}", file=sys.stderr)
    return fault is None


def print_json(value: Any) -> None:
    """Print one JSON object and nothing else on standard output; NaN never leaves as a word JSON lacks."""
    sys.stdout.write(json.dumps(value, indent=2, allow_nan=False) + "\n")  # whole or not at all


def status_line(line: str) -> None:
    """Write over the last line of a terminal, cut to its width so that nothing wraps; a line each time elsewhere."""
    if sys.stderr.isatty():
        columns = shutil.get_terminal_size().columns
        sys.stderr.write(f"\r{line[: columns - 1]}\x1b[K")
    else:
        sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def end_status_line() -> None:
    """Begin a new line after `status_line` on a terminal."""
    if sys.stderr.isatty():
        sys.stderr.write("\n")
        sys.stderr.flush()


def answer(json: bool, figures: Any, *shown: str | Callable[[], None] | None) -> None:
    """Print the result of a command: one JSON object with `json`, else lines of text and what callables print."""
    if json:
        print_json(figures)
        return
    for part in shown:
        if callable(part):
            part()
        elif part is not None:
            typer.echo(part)


def print_table(
    kinds: str, columns: Sequence[str], rows: Iterable[Iterable[Any]], title: str | None = None, **look: Any
) -> None:
    """Print a table on standard output.

    `kinds` has a letter for each column, of which the last holds for all columns that follow: t for text, T for text on
    one line, n for numbers. Text is printed without markup, other values by `format_value`. `look` are options of
    `rich.table.Table`.
    """
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title and escape(title), title_justify="left", **look)
    for column, kind in zip(columns, kinds.ljust(len(columns), kinds[-1]), strict=True):
        side: Literal["left", "right"] = "right" if kind == "n" else "left"
        table.add_column(column, justify=side, no_wrap=kind == "T", overflow="fold")
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(format_value(cell)) for cell in row))
    console = Console(highlight=False)
    # A pipe or a file has no width to fit into.
    Console(highlight=False, width=console.width if console.is_terminal else 140).print(table)


def format_value(value: Any) -> str:
    """A figure as people read it: four significant digits, words for what is missing."""
    if value is None:
        return "—"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        if value != 0 and math.isfinite(value) and abs(value) < 0.01:
            return f"{value:.2g}"
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"
    return str(value)


def interval(low: float | None, high: float | None, unknown: str = "") -> str:
    """An interval as people read it; `unknown` where there is none."""
    return unknown if low is None else f"{format_value(low)} to {format_value(high)}"


_IN_NAMES = {"m/s": "m_s", "%": "pct", "1/m": "per_m", "1/s": "per_s"}


def unit_suffix(key: str, unit: str) -> str:
    """The unit to print beside a figure's name; nothing where the name ends in it or holds it."""
    return "" if f"_{_IN_NAMES.get(unit, unit)}_" in f"{key}_" else unit


def unique_reasons(why: Mapping[str, str], keys: Sequence[str]) -> list[str]:
    """A line for every reason that one of these figures is missing for; figures that share a reason share the line."""
    shared: dict[str, list[str]] = {}
    for key in keys:
        if key in why:
            shared.setdefault(why[key], []).append(key)
    return [f"{', '.join(failed)}: {reason}" for reason, failed in shared.items()]
