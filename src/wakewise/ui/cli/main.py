"""The `wakewise` program: its commands, and errors as one line and an exit code."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import typer
from typer.core import TyperGroup

from wakewise import __version__
from wakewise.core.errors import InputError, MissingExtra, WakewiseError, environment_failure
from wakewise.core.jit import cache_dir
from wakewise.ui.cli import (
    allocate,
    calibrate,
    campaign,
    cockpit,
    color,
    compare,
    compare_models,
    evaluate,
    export,
    film,
    measure,
    photos,
    precompile,
    reconstruct,
    scan,
    tank,
    target,
    vehicle,
    wake,
    world,
)
from wakewise.ui.cli.commands import FLIGHT, PANELS, PHOTOGRAPHS, STUDIES, VEHICLES, CliCommand, installed_commands
from wakewise.ui.cli.console import quiet_progress
from wakewise.ui.cli.signals import EXIT_INTERRUPTED, INTERRUPTED, close_output, exit_code, program_signals

_COMMANDS = (
    CliCommand(FLIGHT, "scan", scan.scan),
    CliCommand(FLIGHT, "compare", compare.compare),
    CliCommand(FLIGHT, "cockpit", cockpit.cockpit),
    CliCommand(FLIGHT, "film", film.film),
    CliCommand(FLIGHT, "export", export.export),
    CliCommand(FLIGHT, "world", world.app),
    CliCommand(FLIGHT, "tank", tank.app),
    CliCommand(FLIGHT, "target", target.app),
    CliCommand(PHOTOGRAPHS, "photos", photos.app),
    CliCommand(PHOTOGRAPHS, "reconstruct", reconstruct.reconstruct_photos),
    CliCommand(PHOTOGRAPHS, "evaluate", evaluate.evaluate),
    CliCommand(PHOTOGRAPHS, "measure", measure.measure),
    CliCommand(PHOTOGRAPHS, "compare-models", compare_models.compare_models),
    CliCommand(PHOTOGRAPHS, "calibrate", calibrate.calibrate),
    CliCommand(PHOTOGRAPHS, "colour", color.colour),
    CliCommand(VEHICLES, "vehicle", vehicle.app),
    CliCommand(VEHICLES, "allocate", allocate.allocate),
    CliCommand(VEHICLES, "wake", wake.app),
    CliCommand(STUDIES, "campaign", campaign.app),
    CliCommand(STUDIES, "compile", precompile.warm),
    *installed_commands(),
)


class _Panels(TyperGroup):
    """A group whose help lists its commands by panel, panels in the order of `PANELS`."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each panel."""
        del ctx
        width = max(len(command.name) for command in _COMMANDS if command.parent in PANELS)
        for panel in PANELS:
            names = [command.name for command in _COMMANDS if command.parent == panel]
            with formatter.section(panel):
                formatter.write_dl(
                    [
                        (f"{name:<{width}}", self.commands[name].get_short_help_str(formatter.width - 6 - width))
                        for name in names
                    ]
                )


app = typer.Typer(
    name="wakewise",
    cls=_Panels,
    help="Fly over-actuated underwater vehicles so gently that what they photograph stays undisturbed.",
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_GROUPS = {"": app} | {command.name: command.run for command in _COMMANDS if isinstance(command.run, typer.Typer)}
for _command in _COMMANDS:
    _panel = _command.parent if _command.parent in PANELS else None
    _parent = _GROUPS["" if _panel else _command.parent]
    if isinstance(_command.run, typer.Typer):
        _parent.add_typer(_command.run, name=_command.name, rich_help_panel=_panel, no_args_is_help=True)
    else:
        _parent.command(_command.name, rich_help_panel=_panel)(_command.run)

QUIET = "--quiet"
_NEXT_STEP = (
    "Next: `wakewise scan` flies round a simulated coral, reconstructs it and writes a report (first time: 3 min);\n"
    "`wakewise COMMAND -h` explains a command."
)
_STOPPED = "stopped; what was finished is kept, run the same command again to go on"
_BEGIN_ANEW = {
    "photos", "measure", "compare-models", "evaluate", "calibrate", "film", "target", "vehicle", "allocate", "link",
    "cockpit",
}  # fmt: skip
"""Commands that do not go on with a run that was stopped."""


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"wakewise {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    context: typer.Context,
    _version: bool = typer.Option(
        False, "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
    ),
    _quiet: bool = typer.Option(False, QUIET, help="Show no progress; also after the name of a command."),
) -> None:
    """Fly over-actuated underwater vehicles so gently that what they photograph stays undisturbed."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        typer.echo(f"\n{_NEXT_STEP}")


@cache
def _commands() -> Any:
    """All commands with their options, put together once however many are run in a process."""
    return typer.main.get_command(app)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    0 done, 1 failed on good input, 2 bad input, 130 stopped by Ctrl-C, 143 ended by SIGTERM.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    # Wherever it stands: the parser knows options of the program before the command's name only.
    rest = [word for word in words if word != QUIET]
    rest = [*rest[1:], "--help"] if rest[:1] == ["help"] else rest
    try:
        with quiet_progress(len(rest) < len(words)):
            code = _commands()(args=rest, standalone_mode=False)
        sys.stdout.flush()
        if code == EXIT_INTERRUPTED:  # Ctrl-C inside a command
            return _stopped(rest)
        return code if isinstance(code, int) else 0
    except (KeyboardInterrupt, typer.Abort):
        return _stopped(rest)
    except Exception as fault:
        if _made_of_interrupt(fault):
            return _stopped(rest)
        code = _refused(fault)
        if code is not None:
            return code
        if INTERRUPTED.is_set():  # swallowed on its way by a library, which then failed at what it had left undone
            return _stopped(rest)
        raise


def _made_of_interrupt(fault: BaseException | None) -> bool:
    """Whether an error was made of Ctrl-C, as Python 3.11 makes a RuntimeError of one that comes within a class."""
    while fault is not None and not isinstance(fault, KeyboardInterrupt):
        fault = fault.__cause__
    return fault is not None


def _refused(fault: Exception) -> int | None:
    """Say an error that is foreseen in one line and give its exit code; None where it is not."""
    match fault:
        case typer.TyperException() if fault.format_message().startswith("Usage:"):  # a group without a command
            typer.echo(fault.format_message(), err=True)
            return 2
        case typer.TyperException():
            _say(_how_many(fault) or fault.format_message())
            return 2
        case InputError() | MissingExtra():
            _say(str(fault))
            return 2
        case ModuleNotFoundError():
            from wakewise.core.optional_dependencies import missing_extra

            refusal = missing_extra("this command", fault)
            if refusal is not None:
                _say(str(refusal))
            return None if refusal is None else 2
        case WakewiseError():
            _say(str(fault))
        case BrokenPipeError():  # nobody reads on, as after `| head`
            close_output()
        case _:
            failure = environment_failure(fault)
            if failure is None:
                return None
            _say(f"cannot write: {failure}" if isinstance(fault, OSError) and fault.filename is None else str(failure))
            if isinstance(fault, OSError):
                close_output()
    return 1


def _how_many(fault: typer.TyperException) -> str | None:
    """What an option of several values lacks: of too few, the next option is taken for one and told of as no number."""
    option = getattr(fault, "param", None)
    count = getattr(option, "nargs", 1)
    if option is None or count < 2 or type(fault).__name__ == "MissingParameter":
        return None
    return f"{option.opts[0]}: needs {count} numbers, {option.metavar}; one of those given is none"


def _say(message: str) -> None:
    line = " ".join(message.split())
    with suppress(OSError):  # standard error may lie on the full disk, too
        print(f"wakewise: {line}", file=sys.stderr)


def _stopped(words: Sequence[str]) -> int:
    _say("stopped; the same command begins anew" if words and words[0] in _BEGIN_ANEW else _STOPPED)
    return exit_code()


def main() -> None:
    """Entry point of the installed command."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # a figure with a sign that the terminal lacks is still a figure
        sys.stdout.reconfigure(errors="replace")
    with program_signals():
        if cache_dir.CHOSEN is not None:
            _say(
                f"compiled code is kept in {cache_dir.CHOSEN}: the package's folder and the user's cache are read-only"
            )
        code = run()
    sys.exit(code)
