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
Preset = Annotated[
    str, typer.Option("--preset", help="quick (minutes on two cores), standard, or reef, a patch in two levels.")
]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the results; runs/NAME-TARGET-METHOD-SEED if not given.")
]
Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="FIELD=VALUE", help="Change a field, such as mission.standoff_m=0.6; may be repeated."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace a file that exists.")]
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
VehicleFrame = Annotated[str, typer.Option("--frame", help="Body axes of the file: auto, FLU or FRD.")]
ThrustDirection = Annotated[
    str,
    typer.Option(
        "--thrust-direction",
        help="auto (the format's rule), reversed, or an axis of each thruster's own frame: +x, -x, +y, -y, +z, -z.",
    ),
]
XacroArguments = Annotated[
    list[str] | None, typer.Option("--arg", metavar="NAME:=VALUE", help="A xacro argument; may be repeated.")
]
MatrixRows = Annotated[
    str | None,
    typer.Option(
        "--rows",
        metavar="NAMES",
        help="What the six rows of a matrix are, in the file's order, such as roll,pitch,yaw,x,y,z.",
        show_default=False,
    ),
]
XacroPackages = Annotated[
    list[str] | None,
    typer.Option("--package", metavar="NAME=DIR", help="Where a package of a xacro file is; may be repeated."),
]
SkipMissing = Annotated[bool, typer.Option("--skip-missing", help="Leave out xacro includes that are not there.")]


def pairs(option: str, form: str, given: list[str] | None) -> dict[str, str]:
    """Values of a repeated option by their names; `form` is NAME=VALUE, with another word or mark.

    Raises InputError if one is not of this form, or a name comes twice.
    """
    from wakewise.core.errors import InputError

    found: dict[str, str] = {}
    for text in given or []:
        name, mark, value = text.partition(":=" if ":=" in form else "=")
        if not (name and mark and value) or name in found:
            raise InputError(f"{option} {text}: allowed is {form}, each name once")
        found[name] = value
    return found


def check_file(path: Path | None, option: str = "--out", force: bool = True) -> None:
    """Refuse a folder where a file is to be written, and without `force` a file that exists; raises InputError."""
    from wakewise.core.errors import InputError

    if path is not None and path.is_dir():
        raise InputError(f"{option} {path}: is a folder, must be a file")
    if path is not None and path.exists() and not force:
        raise InputError(f"{option} {path}: exists; give another name, or --force to replace it")


def listed(text: str | None) -> tuple[str, ...]:
    """Words between commas."""
    return tuple(word.strip() for word in (text or "").split(",") if word.strip())


def numbers(option: str, text: str) -> tuple[float, ...]:
    """Numbers between commas; raises InputError if one is none."""
    from wakewise.core.errors import InputError

    found = []
    for word in listed(text):
        try:
            found.append(float(word))
        except ValueError:
            raise InputError(f"{option}: '{word}' is not a number, such as 5 or 1,5,20") from None
    return tuple(found)


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
