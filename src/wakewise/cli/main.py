"""The `wakewise` command: joins the commands, and turns errors into one line and an exit code."""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from types import TracebackType
from typing import Any

import typer

from wakewise import __version__, numba_cache
from wakewise.cli import (
    allocate,
    bench,
    calibrate,
    campaign,
    cockpit,
    colour,
    compare,
    degrade,
    evaluate,
    export,
    film,
    link,
    nerf,
    reconstruct,
    reproduce,
    scan,
    tank,
    target,
    vehicle,
    wake,
    warm,
    world,
)
from wakewise.cli.console import INTERRUPTED
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
app.command("cockpit")(cockpit.cockpit)
app.command("compare")(compare.compare)
app.command("reconstruct")(reconstruct.reconstruct_photos)
app.command("evaluate")(evaluate.evaluate)
app.command("calibrate")(calibrate.calibrate)
app.command("degrade")(degrade.degrade)
app.command("film")(film.film)
app.command("export")(export.export)
app.command("colour")(colour.colour)
app.command("nerf")(nerf.nerf)
app.command("allocate")(allocate.allocate)
app.command("bench")(bench.bench)
app.command("reproduce")(reproduce.reproduce)
app.command("warm")(warm.warm)
app.add_typer(vehicle.app, name="vehicle")
app.add_typer(tank.app, name="tank")
app.add_typer(target.app, name="target")
app.add_typer(wake.app, name="wake")
app.add_typer(world.app, name="world")
app.add_typer(link.app, name="link")
app.add_typer(campaign.app, name="campaign")

_INTERRUPTED = 130
_TERMINATED = 143
_terminated = False
# Libraries tell of the computer's faults in exceptions of their own: by their words, and what to say instead.
_COMPUTER = {
    "No space left on device": "the disk is full",
    "no locator available": "compiled code can be kept nowhere; set NUMBA_CACHE_DIR to a folder that can be written",
}
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


@cache
def _commands() -> Any:
    """All commands with their options, put together once however many are run in a process."""
    return typer.main.get_command(app)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    0 done, 1 failed on good input, 2 bad input, 130 stopped by Ctrl-C, 143 ended by SIGTERM.
    """
    try:
        code = _commands()(args=arguments, standalone_mode=False)
        sys.stdout.flush()
        if code == _INTERRUPTED:  # Ctrl-C inside a command
            return _stopped()
        return code if isinstance(code, int) else 0
    except (KeyboardInterrupt, typer.Abort):
        return _stopped()
    except Exception as fault:
        if _made_of_interrupt(fault):
            return _stopped()
        code = _refused(fault)
        if code is not None:
            return code
        if INTERRUPTED.is_set():  # swallowed on its way by a library, which then failed at what it had left undone
            return _stopped()
        raise


def _made_of_interrupt(fault: BaseException | None) -> bool:
    """Whether an error was made of Ctrl-C, as Python 3.11 makes a RuntimeError of one that comes within a class."""
    while fault is not None and not isinstance(fault, KeyboardInterrupt):
        fault = fault.__cause__
    return fault is not None


def _refused(fault: Exception) -> int | None:
    """Say an error that is foreseen in one line and give its exit code; None where it is not."""
    match fault:
        case typer.TyperException():
            _say(fault.format_message())
            return 2
        case InputError() | MissingExtra():
            _say(str(fault))
            return 2
        case ModuleNotFoundError():
            from wakewise.extras import missing_extra

            refusal = missing_extra("this command", fault)
            if refusal is not None:
                _say(str(refusal))
            return None if refusal is None else 2
        case WakewiseError():
            _say(str(fault))
        case BrokenPipeError():  # nobody reads on, as after `| head`
            _close_output()
        case OSError():
            where = "cannot write: " if fault.filename is None else f"{fault.filename}: "
            _say(f"{where}{fault.strerror or fault}")
            _close_output()
        case MemoryError():
            _say(f"out of memory ({fault})" if str(fault) else "out of memory")
        case _:
            told = next((said for words, said in _COMPUTER.items() if words in str(fault)), None)
            if told is None:
                return None
            _say(told)
    return 1


def _say(message: str) -> None:
    line = " ".join(message.split())
    with suppress(OSError):  # standard error may lie on the full disk, too
        print(f"wakewise: {line}", file=sys.stderr)


def _stopped() -> int:
    _say(_STOPPED)
    return _TERMINATED if _terminated else _INTERRUPTED


def _close_output() -> None:
    """Drop what could not be written, else Python tries again at its end and tells of it in words of its own."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _terminate(*_: Any) -> None:
    """End as after Ctrl-C, so that whatever is half-done is tidied up; a second SIGTERM does not disturb that."""
    global _terminated  # noqa: PLW0603
    _terminated = True
    INTERRUPTED.set()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _interrupt(*_: Any) -> None:
    """Ctrl-C: remembered as well as raised, since libraries that try imports or call back from C may swallow it."""
    INTERRUPTED.set()
    raise KeyboardInterrupt


def _unraisable(fault: sys.UnraisableHookArgs) -> None:
    """Ctrl-C in a call back from C cannot be raised there; it is remembered, and no stack needs to tell of it."""
    if not isinstance(fault.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(fault)


def _uncaught(kind: type[BaseException], fault: BaseException, trace: TracebackType | None) -> None:
    """The same where C prints what it cannot raise: of Python's own code none but `run` would let Ctrl-C through."""
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, fault, trace)


def main() -> None:
    """Entry point of the installed command."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # a figure with a sign that the terminal lacks is still a figure
        sys.stdout.reconfigure(errors="replace")
    signal.signal(signal.SIGTERM, _terminate)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a job in the background has it ignored
        signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook, sys.excepthook = _unraisable, _uncaught
    if numba_cache.CHOSEN is not None:
        _say(f"compiled code is kept in {numba_cache.CHOSEN}: the package's folder and the user's cache are read-only")
    code = run()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is said: an impatient Ctrl-C must not end it with a stack
    sys.exit(code)
