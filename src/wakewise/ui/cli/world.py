"""`wakewise world`: the worlds of the library, what each is made of, and what a seed draws from it."""

from __future__ import annotations

import textwrap
from typing import Annotated, Any

import typer

from wakewise.ui.cli.console import answer, print_json, print_table
from wakewise.ui.cli.options import Json, seed_option

app = typer.Typer(help="Worlds: list, show what each is made of and why.")

_WIDTH = 100


@app.command("list")
def list_worlds(json: Json = False) -> None:
    """List the worlds: what each is, and which one presets fly in."""
    from wakewise.operation import load_scenario
    from wakewise.operation.worlds.library import load_world, world_names

    default = load_scenario("quick", None, {}).world
    worlds = [load_world(name) for name in world_names()]
    rows = [{"name": world.name, "title": world.file.title, "why": world.file.why} for world in worlds]
    width = max(len(world.name) for world in worlds)
    marks = {default: " (of the presets)"}
    lines = (f"{world.name:<{width}}  {world.file.title}{marks.get(world.name, '')}" for world in worlds)
    answer(json, {"worlds": rows, "default_world": default}, *lines)


@app.command("show")
def show(
    name: Annotated[str, typer.Argument(help="A world of the library; see `wakewise world list`.")],
    seed: Annotated[int | None, typer.Option(callback=seed_option, help="Show what this seed draws.")] = None,
    json: Json = False,
) -> None:
    """Show a world: why it is flown, its fields, from where a seed draws them, and the source of each number."""
    from wakewise.core.errors import InputError
    from wakewise.operation import load_scenario
    from wakewise.operation.scenario.randomization import sample_fields
    from wakewise.operation.worlds.library import load_world

    world = load_world(name)
    try:
        load_scenario("quick", None, {"world": name})  # its fields are a scenario's
    except InputError as fault:
        raise InputError(f"world {name}: {fault}") from None
    drawn = sample_fields(world.randomize, seed) if seed is not None else {}
    if json:
        fields: dict[str, Any] = {}
        for dotted, entry in world.file.fields.items():
            fields[dotted] = entry.model_dump(exclude_none=True)
            if dotted in drawn:
                fields[dotted]["drawn"] = drawn[dotted]
        print_json({"name": name, "title": world.file.title, "why": world.file.why, "fields": fields, "seed": seed})
        return
    typer.echo(f"{name}: {world.file.title}\n")
    typer.echo(textwrap.fill(world.file.why, _WIDTH) + "\n")
    rows = []
    for dotted, entry in world.file.fields.items():
        value = _shown(entry.value) if entry.randomize is None else f"drawn: {entry.randomize}"
        now = () if seed is None else (_shown(drawn.get(dotted, entry.value)),)
        rows.append((dotted, value, *now, " ".join(entry.source.split())))
    columns = ("field", "value", *(() if seed is None else (f"seed {seed}",)), "source")
    print_table("t", columns, rows, show_lines=True)


def _shown(value: Any) -> str:
    return ", ".join(map(_shown, value)) if isinstance(value, list | tuple) else f"{value}"
