"""The `wakewise` command: joins the commands, and turns errors into one line and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import typer

from wakewise import __version__
from wakewise.cli import (
    allocate,
    bench,
    calibrate,
    colour,
    compare,
    degrade,
    evaluate,
    film,
    nerf,
    reconstruct,
    scan,
    tank,
    target,
    vehicle,
    wake,
)
from wakewise.errors import InputError, MissingExtra, WakewiseError

app = typer.Typer(
    name="wakewise",
    help="Fly over-actuated underwater vehicles so gently that what they photograph stays undisturbed.",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("scan")(scan.scan)
app.command("compare")(compare.compare)
app.command("reconstruct")(reconstruct.reconstruct_photos)
app.command("evaluate")(evaluate.evaluate)
app.command("calibrate")(calibrate.calibrate)
app.command("degrade")(degrade.degrade)
app.command("film")(film.film)
app.command("colour")(colour.colour)
app.command("nerf")(nerf.nerf)
app.command("allocate")(allocate.allocate)
app.command("bench")(bench.bench)
app.add_typer(vehicle.app, name="vehicle")
app.add_typer(tank.app, name="tank")
app.add_typer(target.app, name="target")
app.add_typer(wake.app, name="wake")

_INTERRUPTED = 130
_STOPPED = "stopped; what was finished is kept, run the same command again to go on"


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"wakewise {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    context: typer.Context,
    version: bool = typer.Option(  # noqa: ARG001  (its callback does the work)
        False, "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
    ),
) -> None:
    """Fly over-actuated underwater vehicles so gently that what they photograph stays undisturbed."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 1 failed on good input, 2 bad input, 130 stopped by Ctrl-C."""
    try:
        code = app(args=arguments, standalone_mode=False)
        if code == _INTERRUPTED:  # Ctrl-C inside a command
            _say(_STOPPED)
        return code if isinstance(code, int) else 0
    except typer.TyperException as fault:
        _say(fault.format_message())
        return 2
    except (InputError, MissingExtra) as fault:
        _say(str(fault))
        return 2
    except ModuleNotFoundError as fault:
        from wakewise.extras import missing_extra

        refusal = missing_extra("this command", fault)
        if refusal is None:
            raise
        _say(str(refusal))
        return 2
    except WakewiseError as fault:
        _say(str(fault))
        return 1
    except (KeyboardInterrupt, typer.Abort):
        _say(_STOPPED)
        return _INTERRUPTED


def _say(message: str) -> None:
    line = " ".join(message.split())
    print(f"wakewise: {line}", file=sys.stderr)


def main() -> None:
    """Entry point of the installed command."""
    sys.exit(run())
