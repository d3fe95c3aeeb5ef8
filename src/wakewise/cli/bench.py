"""`wakewise bench`: speed and quality of one part, side by side with a peer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.cli.console import Bars, print_json, shown
from wakewise.cli.options import Json

Name = Annotated[str, typer.Argument(help="Which bench; without a name, all of them.", show_default=False)]
Data = Annotated[
    Path, typer.Option(help="Folder of reference data that some figures are held against.", envvar="WAKEWISE_DATA")
]


def bench(name: Name = "", data: Data = Path("../shared/data"), json: Json = False) -> None:
    """Measure speed and quality of one part: thread CPU, median and p99 after warm-up.

    A figure that needs reference data which is not there is null, with the reason in `why`.
    """
    from wakewise.experiments.benches import BENCHES, BenchOptions, run_bench

    names = [name] if name else sorted(BENCHES)
    results: dict[str, Any] = {}
    bars = Bars()
    for each in names:
        with bars.stage(f"bench {each}") as progress:
            options = BenchOptions(data=data if data.is_dir() else None, progress=progress)
            results[each] = run_bench(each, options)
    if json:
        print_json(results[name] if name else results)
        return
    for each, result in results.items():
        typer.echo(f"\n{each}: {BENCHES[each]}")
        _show(result, "  ")


def _show(result: dict[str, Any], indent: str) -> None:
    for key, value in result.items():
        if isinstance(value, dict) and set(value) == {"median_us", "p99_us"}:
            typer.echo(f"{indent}{key:<34}{value['median_us']:>10.1f} us   p99 {value['p99_us']:.1f} us")
        elif isinstance(value, dict):
            typer.echo(f"{indent}{key}")
            _show(value, indent + "  ")
        else:
            typer.echo(f"{indent}{key:<34}{shown(value):>10}")
