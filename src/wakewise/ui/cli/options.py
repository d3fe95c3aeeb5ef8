"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from wakewise.operation import Scenario

ScenarioFile = Annotated[
    Path | None, typer.Argument(help="Scenario YAML file; any part of a scenario.", show_default=False)
]
Preset = Annotated[str, typer.Option("--preset", help="quick (minutes on two cores) or standard.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the results; runs/NAME-TARGET-METHOD-SEED if not given.")
]
Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="FIELD=VALUE", help="Change a field, such as mission.standoff_m=0.6; may be repeated."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]


def seed_option(value: int | None) -> int | None:
    """A seed as it was given, if it is one (see `wakewise.core.settings.seed_number`)."""
    if value is None:
        return None
    from wakewise.core.settings import seed_number

    return seed_number(value, "--seed")


Seed = Annotated[
    int | None, typer.Option("--seed", callback=seed_option, help="Seed of every random draw.", show_default=False)
]
Vehicle = Annotated[
    str | None, typer.Option("--vehicle", help="Library name or vehicle YAML file.", show_default=False)
]
World = Annotated[
    str | None,
    typer.Option(
        "--world", help="Where it is flown; see `wakewise world list`. lattice is a second judge.", show_default=False
    ),
]
TargetName = Annotated[
    str | None,
    typer.Option(
        "--target",
        help="anemone, brain, branching, gorgonian, plate, seagrass, soft-coral, or a mesh file.",
        show_default=False,
    ),
]
TargetSize = Annotated[
    float | None,
    typer.Option("--target-size", metavar="M", help="Scale a mesh file's largest extent to this.", show_default=False),
]


def default_folder(scenario: Scenario, what: str) -> Path:
    """Folder of a trial that was given none: another target, method or seed goes elsewhere."""
    from wakewise.core.files import child_path

    name = f"{scenario.name}-{Path(scenario.target.kind).stem}-{what}-{scenario.seed}"
    return child_path(Path("runs"), name.replace(":", "-"), "--out")


def overrides(
    sets: list[str] | None,
    *,
    seed: int | None,
    vehicle: str | None,
    target: str | None,
    target_size: float | None,
    method: str | None = None,
    world: str | None = None,
) -> dict[str, Any]:
    """Join the short options and --set into dotted fields; --set is read first, so the short options win."""
    from wakewise.operation import parse_overrides

    short = {
        "seed": seed,
        "vehicle": vehicle,
        "target.kind": target,
        "target.size_m": target_size,
        "method": method,
        "world": world,
    }
    return parse_overrides(sets or []) | {name: value for name, value in short.items() if value is not None}
