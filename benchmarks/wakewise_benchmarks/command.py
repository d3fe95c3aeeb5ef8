"""`wakewise bench`: speed and quality of one part, side by side with a peer.

What `wakewise bench adversarial-photos` prints: a row per case, and how many were silent.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.ui.cli.commands import STUDIES, CliCommand
from wakewise.ui.cli.console import ProgressBars, format_value, print_json, write_page
from wakewise.ui.cli.options import Json, listed, numbers


def show_adversarial_cases(result: dict[str, Any]) -> None:
    """A row per case: verdict, photographs with a place, error of the cameras, and what was said."""
    for name, row in result["cases"].items():
        placed = f"{row['registered']} of {row['photos']}"
        off = "" if row["off_pct"] is None else f"{format_value(row['off_pct'])} %"
        typer.echo(f"  {name:<20}{row['verdict']:<8}{placed:>9}{off:>9}  {row['why']}")
        for words in row["said"]:
            typer.echo(f"  {'':<20}  {words}")
    typer.echo(f"  right {result['right']}, said {result['said']}, silently wrong {result['silent_wrongs']}")


_SEEDS = {"front": 8, "gentle": 3, "models": 1000, "operator": 3, "reef": 3}
"""Seeds of a bench that flies, if not given; 10 of the others."""
_SHOWN = {
    "adversarial-photos": f"{__name__}:show_adversarial_cases",
    "front": "wakewise_paper.cli.bench_models:show_front",
    "gentle": "wakewise_paper.cli.bench_wash:show_gentle",
    "models": "wakewise_paper.cli.bench_models:show_models",
    "onboard": "wakewise_benchmarks.onboard:show_onboard",
    "operator": "wakewise_paper.cli.bench_operator:show_operator",
    "reef": "wakewise_benchmarks.reef:show_reef",
    "survey": "wakewise_benchmarks.survey:show_survey",
    "tank": "wakewise_benchmarks.tank_scaling:show_tank",
    "target": "wakewise_benchmarks.target_finding:show_target",
    "truth": "wakewise_benchmarks.truth:show_truth",
    "worlds": "wakewise_paper.cli.bench_worlds:show_worlds",
}
"""What prints the answer of a bench that has tables of its own."""
_DRAWN = {
    "front": "wakewise_paper.reports.models_bench_plot:draw_front",
    "gentle": "wakewise_paper.reports.wash_bench_plot:draw_gentle",
    "models": "wakewise_paper.reports.models_bench_plot:draw_models",
    "operator": "wakewise_paper.reports.operator_bench_plot:draw_operator",
    "tank": "wakewise_benchmarks.tank_scaling_plot:draw_scaling",
    "truth": "wakewise_benchmarks.cube_channel_plot:draw_cube",
}
"""What draws the answer of a bench: pictures need an extra."""

_LASTS = {
    "front": "hours",
    "gentle": "hours",
    "models": "hours",
    "operator": "hours",
    "reef": "hours",
    "target": "hours",
    "worlds": "hours",
}
"""About how long a bench runs on two free cores, where it is not minutes at most."""


def bench(
    name: Annotated[
        str, typer.Argument(help="Which bench, or all; without a name they are listed.", show_default=False)
    ] = "",
    data: Annotated[
        Path, typer.Option(help="Folder of reference data that some figures are held against.", envvar="WAKEWISE_DATA")
    ] = Path("../shared/data"),
    seeds: Annotated[
        int | None,
        typer.Option(
            help="front, gentle, models, operator, target, worlds: flights per method; 8, 3, what the cases say, 3, 10 "
            "and 10; reef: patches, 3; survey: flights over each relief, 10.",
            min=1,
            max=1000,
        ),
    ] = None,
    methods: Annotated[
        str,
        typer.Option(
            help="front, gentle, models, worlds: methods, with commas between; reef: surveys of which models are made; "
            "all if not given.",
            show_default=False,
        ),
    ] = "",
    scenarios: Annotated[
        str,
        typer.Option(
            help="gentle: which, with commas between: orbit (both vehicles), orbit/paper, worlds, world/mud, paper "
            "(the paper's own world); models: mechanisms, doses, advice, sheltered; adversarial-photos: by name; "
            "all if not given.",
            show_default=False,
        ),
    ] = "",
    mechanisms: Annotated[
        str, typer.Option(help="gentle: mechanisms to switch, with commas between, or all.", show_default=False)
    ] = "",
    worlds: Annotated[
        str,
        typer.Option(
            help="front, operator, target, worlds: which, with commas between; operator flies those with trouble and a "
            "calm one, the others all of theirs, if not given.",
            show_default=False,
        ),
    ] = "",
    w_tracks: Annotated[
        str, typer.Option(help="operator: weights, with commas between; 1,2,5,10,20 if not given.", show_default=False)
    ] = "",
    models: Annotated[
        int,
        typer.Option(
            help="target, worlds: seeds for which whole scans are made and models judged; reef: patches.",
            min=0,
            max=1000,
        ),
    ] = 1,
    judge: Annotated[
        int, typer.Option(help="worlds: seeds flown in the lattice as well, minutes of a core each.", min=0, max=1000)
    ] = 0,
    bound: Annotated[
        int,
        typer.Option(
            help="gentle: seeds for which the most is worked out that sharing thrusts out could gain, two minutes of "
            "a core each; the whole is --methods dp,no-forward-jets,wake-aware --bound 3.",
            min=0,
            max=1000,
        ),
    ] = 0,
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh", help="front, gentle, models, operator, target, worlds: fly anew what is known already."
        ),
    ] = False,
    workers: Annotated[
        int,
        typer.Option(
            help="front, gentle, models, operator, target, worlds: processes that fly side by side.", min=1, max=64
        ),
    ] = 2,
    store: Annotated[
        Path | None,
        typer.Option(
            help="front, gentle, models, operator, target, worlds: folder that keeps flights; the cache if not given."
        ),
    ] = None,
    only: Annotated[
        str,
        typer.Option(
            help="gpu: lattice, colmap, field, with commas between; truth: which folders of the data, such as "
            "dynamics,cube_channel; all if not given.",
            show_default=False,
        ),
    ] = "",
    plot: Annotated[
        Path | None,
        typer.Option(
            help="front, gentle, models, operator, tank, truth: draw the figures into this file (.png, .svg, .pdf); of "
            "truth the cube, of models the doses, of tank how costs grow."
        ),
    ] = None,
    photographs: Annotated[
        str,
        typer.Option(help="photographs: how many, with commas between; 12,24 if not given.", show_default=False),
    ] = "",
    json: Json = False,
) -> None:
    """Measure speed and quality of one part: thread CPU, median and p99 after warm-up.

    A figure that needs reference data which is not there is null, with the reason in `why`. `gentle` flies all of its
    scenarios and worlds for more than an hour on two free cores, some minutes with `--scenarios orbit/paper`; a run
    that was stopped goes on where it was. `truth` takes about 10 minutes of one core, most of it for the lattice round
    a cube and for photographs; `--only` chooses.
    """
    from wakewise.core.errors import STRICT, InputError
    from wakewise.core.optional_dependencies import need
    from wakewise.experiments.trials import BenchOptions
    from wakewise_benchmarks.registry import BENCHES, run_bench

    if plot is not None and name not in _DRAWN:
        raise InputError(f"--plot: bench {name or 'without a name'} draws nothing, those that do: {', '.join(_DRAWN)}")
    for option, given in (
        ("--methods", methods), ("--scenarios", scenarios), ("--mechanisms", mechanisms), ("--worlds", worlds),
        ("--only", only),
    ):  # fmt: skip
        if given and not listed(given):
            raise InputError(f"{option} '{given}': no name in it; leave it out for all")
    if only and name not in ("truth", "gpu", "all"):
        raise InputError("--only: of `wakewise bench truth` and `wakewise bench gpu` alone")
    if name == "truth" and not data.is_dir():
        raise InputError(f"--data {data}: no such folder; --data or WAKEWISE_DATA must name the reference data")
    if name == "truth" or (name == "all" and only):
        from wakewise_benchmarks.truth import chosen

        chosen(listed(only) or None)
    needed = {"models": ("--scenarios", scenarios, "doses"), "truth": ("--only", only, "cube_channel")}.get(name)
    if plot is not None and needed is not None and needed[1] and needed[2] not in listed(needed[1]):
        raise InputError(f"--plot: draws {needed[2]}, which {needed[0]} leaves out")
    if plot is not None:
        need("--plot", "reports")
        if plot.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise InputError(f"--plot {plot}: ending '{plot.suffix}', allowed .png, .svg, .pdf")
    os.environ.setdefault(STRICT, "1")  # a mistake of the program ends a measurement; a fallback is not measured
    if not name:
        _list(BENCHES, json)
        return
    names = sorted(BENCHES) if name == "all" else [name]
    results: dict[str, Any] = {}
    bars = ProgressBars()
    for each in names:
        with bars.stage(f"bench {each}") as progress:
            options = BenchOptions(
                data=data if data.is_dir() else None,
                progress=progress,
                seeds=seeds or _SEEDS.get(each, 10),
                methods=listed(methods) or None,
                scenarios=listed(scenarios) or None,
                mechanisms=listed(mechanisms) or None,
                worlds=listed(worlds) or None,
                w_tracks=numbers("--w-tracks", w_tracks) or None,
                models=models,
                judge=judge,
                bound=bound,
                fresh=fresh,
                workers=workers,
                store=store,
                only=listed(only) or None,
                photographs=_counts(photographs),
            )
            results[each] = run_bench(each, options)
            if each == "operator":
                from wakewise_paper.cli.bench_cockpit import add_cockpit

                add_cockpit(results[each], options)
    if plot is not None:
        draw = _named(_DRAWN[name])
        write_page("plot", lambda: draw(results[name], plot))
    if json:
        print_json(results if name == "all" else results[name])
        return
    for each, result in results.items():
        typer.echo(f"\n{each}: {BENCHES[each]}")
        show = _named(_SHOWN[each]) if each in _SHOWN else _show
        show(result)


def _counts(text: str) -> tuple[int, ...] | None:
    """Whole numbers of --photographs."""
    from wakewise.core.errors import InputError

    found = numbers("--photographs", text)
    if any(count != int(count) for count in found):
        raise InputError(f"--photographs: '{text}', must be whole numbers, such as 12,24")
    return tuple(map(int, found)) or None


def _named(place: str) -> Callable[..., None]:
    """The function of MODULE:NAME, imported now."""
    module, _, name = place.partition(":")
    function: Callable[..., None] = getattr(import_module(module), name)
    return function


def _list(benches: Mapping[str, str], json: bool) -> None:
    """Say which benches there are and how long they take, and run none."""
    lasts = {name: _LASTS.get(name, "minutes") for name in benches}
    if json:
        print_json({"benches": {name: {"what": what, "lasts": lasts[name]} for name, what in benches.items()}})
        return
    width = max(map(len, benches))
    for name, what in sorted(benches.items()):
        typer.echo(f"{name:<{width}}  {lasts[name]:<7}  {what}")
    typer.echo("\nwakewise bench NAME runs one, wakewise bench all runs all of them, one after another: many hours")


def _show(result: dict[str, Any], indent: str = "  ") -> None:
    for key, value in result.items():
        if isinstance(value, dict) and set(value) == {"median_us", "p99_us"}:
            typer.echo(f"{indent}{key:<34}{value['median_us']:>10.1f} us   p99 {value['p99_us']:.1f} us")
        elif isinstance(value, dict):
            typer.echo(f"{indent}{key}")
            _show(value, indent + "  ")
        else:
            typer.echo(f"{indent}{key:<34}{format_value(value):>10}")


COMMANDS = (CliCommand(STUDIES, "bench", bench),)
"""What this package adds to `wakewise`."""
