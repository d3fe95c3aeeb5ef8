"""`wakewise bench`: speed and quality of one part, side by side with a peer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.cli.bench_worlds import show_worlds
from wakewise.cli.console import Bars, print_json, shown
from wakewise.cli.options import Json

Name = Annotated[str, typer.Argument(help="Which bench; without a name, all of them.", show_default=False)]
Data = Annotated[
    Path, typer.Option(help="Folder of reference data that some figures are held against.", envvar="WAKEWISE_DATA")
]
Seeds = Annotated[int, typer.Option(help="gentle, worlds: flights per method, seeds 1 to this.", min=1, max=1000)]
Methods = Annotated[
    str, typer.Option(help="gentle, worlds: methods, with commas between; all if not given.", show_default=False)
]
Worlds = Annotated[str, typer.Option(help="worlds: which, with commas between; all if not given.", show_default=False)]
Models = Annotated[
    int, typer.Option(help="worlds: seeds for which a whole scan is made and its model judged.", min=0, max=1000)
]
Flows = Annotated[str, typer.Option(help="gentle: parcels (the tank) or paper; both if not given.", show_default=False)]
Levers = Annotated[
    str, typer.Option(help="gentle: levers, with commas between, or none; all if not given.", show_default=False)
]
Judge = Annotated[
    int,
    typer.Option(help="worlds: seeds flown in the lattice as well, minutes of a core each.", min=0, max=1000),
]
Fresh = Annotated[bool, typer.Option("--fresh", help="gentle, worlds: fly anew what an earlier run has flown.")]
Workers = Annotated[int, typer.Option(help="gentle, worlds: processes that fly side by side.", min=1, max=64)]
Store = Annotated[
    Path | None,
    typer.Option(help="gentle, worlds: folder that keeps flights; the user's cache if not given.", show_default=False),
]
Plot = Annotated[
    Path | None,
    typer.Option(help="gentle, operator: draw the figures into this file (.png, .svg).", show_default=False),
]


def bench(
    name: Name = "",
    data: Data = Path("../shared/data"),
    seeds: Seeds = 10,
    methods: Methods = "",
    flows: Flows = "",
    levers: Levers = "",
    worlds: Worlds = "",
    models: Models = 1,
    judge: Judge = 0,
    fresh: Fresh = False,
    workers: Workers = 2,
    store: Store = None,
    plot: Plot = None,
    json: Json = False,
) -> None:
    """Measure speed and quality of one part: thread CPU, median and p99 after warm-up.

    A figure that needs reference data which is not there is null, with the reason in `why`. `gentle` flies for a
    quarter of an hour on two free cores; a run that was stopped goes on where it was.
    """
    from wakewise.benches import BENCHES, run_bench
    from wakewise.errors import InputError
    from wakewise.extras import need
    from wakewise.trials import BenchOptions

    if plot is not None and name not in ("gentle", "operator"):
        raise InputError("--plot: only `wakewise bench gentle` and `wakewise bench operator` draw")
    if plot is not None:
        need("--plot", "reports")
    names = [name] if name else sorted(BENCHES)
    results: dict[str, Any] = {}
    bars = Bars()
    for each in names:
        with bars.stage(f"bench {each}") as progress:
            options = BenchOptions(
                data=data if data.is_dir() else None,
                progress=progress,
                seeds=seeds,
                methods=_listed(methods),
                flows=_listed(flows),
                levers=_listed(levers),
                worlds=_listed(worlds),
                models=models,
                judge=judge,
                fresh=fresh,
                workers=workers,
                store=store,
            )
            results[each] = run_bench(each, options)
    if plot is not None:
        from wakewise.reports.levers import draw_levers
        from wakewise.reports.operator import draw_operator

        draw = {"gentle": draw_levers, "operator": draw_operator}[name]
        draw(results[name], plot)
    if json:
        print_json(results[name] if name else results)
        return
    for each, result in results.items():
        typer.echo(f"\n{each}: {BENCHES[each]}")
        if each == "gentle":
            _show_gentle(result)
        elif each == "worlds":
            show_worlds(result)
        else:
            _show(result, "  ")


def _listed(text: str) -> tuple[str, ...] | None:
    """Names between commas; None for none given."""
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    return names or None


def _show(result: dict[str, Any], indent: str) -> None:
    for key, value in result.items():
        if isinstance(value, dict) and set(value) == {"median_us", "p99_us"}:
            typer.echo(f"{indent}{key:<34}{value['median_us']:>10.1f} us   p99 {value['p99_us']:.1f} us")
        elif isinstance(value, dict):
            typer.echo(f"{indent}{key}")
            _show(value, indent + "  ")
        else:
            typer.echo(f"{indent}{key:<34}{shown(value):>10}")


def _show_gentle(result: dict[str, Any]) -> None:
    """Two tables per flow: methods, and levers."""
    from rich.table import Table

    from wakewise.cli.console import print_table

    columns = (
        ("target_speed_mean_m_s", "target mm/s", 1e3),
        ("exposure_speed_mean_m_s", "exposing mm/s", 1e3),
        ("position_rmse_mm", "position mm", 1.0),
        ("path_rmse_mm", "path mm", 1.0),
        ("velocity_deviation_pct", "velocity %", 1.0),
        ("energy_kJ", "energy kJ", 1.0),
        ("sign_flips_per_s", "flips/s", 1.0),
    )
    for flow, figures in result["flows"].items():
        words = "circular: the planner's own model is the water" if figures["circular"] else "the tank's water"
        table = Table(title=f"{flow} ({words}), {figures['seeds']} seeds", title_justify="left")
        table.add_column("method")
        for _, title, _ in columns:
            table.add_column(title, justify="right")
        table.add_column("wake-aware moves less by", justify="right")
        for method, row in figures["methods"].items():
            less = figures.get(f"reduction_vs_{method.replace('-', '_')}_pct")
            interval = figures.get(f"reduction_vs_{method.replace('-', '_')}_interval_pct")
            cells = [shown(None if row[key] is None else scale * row[key]) for key, _, scale in columns]
            table.add_row(method, *cells, _reduction(less, interval))
        print_table(table)
        levers = Table(title=f"{flow}: levers", title_justify="left")
        for title in ("lever", "kind", "held against", "target speed lower by", "than dp by", "position mm"):
            levers.add_column(title, justify="left" if title in ("lever", "kind", "held against") else "right")
        for lever, row in figures["lever_details"].items():
            levers.add_row(
                lever,
                row["group"],
                row["base"],
                _reduction(row["reduction_pct"], row["interval_pct"]),
                _reduction(row["reduction_vs_dp_pct"], row["dp_interval_pct"]),
                shown(row["position_rmse_mm"]),
            )
        print_table(levers)
    typer.echo(
        f"{result['flown']} flights flown, {result['flights'] - result['flown']} known, {result['failed']} failed"
    )
    for failure in result["failures"]:
        typer.echo(f"failed: {failure['flow']}, {failure['name']}, seed {failure['seed']}: {failure['reason']}")


def _reduction(value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None:
        return "—"
    return f"{value:.0f} %" if interval is None else f"{value:.0f} % ({interval[0]:.0f} to {interval[1]:.0f})"
