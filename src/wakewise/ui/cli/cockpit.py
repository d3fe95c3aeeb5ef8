"""`wakewise cockpit`: fly by hand, in the browser."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wakewise.ui.cli import options
from wakewise.ui.cli.console import print_json

if TYPE_CHECKING:
    from wakewise.operation.teleop.input import ControlSource
    from wakewise.ui.cockpit.session import CockpitSession

Gamepad = Annotated[bool, typer.Option("--gamepad", help="Fly with a gamepad at this computer, too.")]

_LOOK_S = 0.1


def cockpit(
    scenario: options.ScenarioFile = None,
    preset: options.Preset = "quick",
    out: options.Out = None,
    target: options.TargetName = None,
    target_size: options.TargetSize = None,
    vehicle: options.Vehicle = None,
    world: options.World = None,
    seed: options.Seed = None,
    sets: options.Sets = None,
    port: Annotated[int, typer.Option(help="Port of the page; 0 takes any that is free.", min=0, max=65535)] = 8765,
    host: Annotated[
        str,
        typer.Option(help="Address to listen at. Any but this computer's own asks for the token that is printed then."),
    ] = "127.0.0.1",
    origin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="Where browsers ask for the page if a proxy stands before it, as BlueOS does: http://192.168.2.2; "
            "may be given more than once. The token is asked of everybody then.",
        ),
    ] = None,
    gamepad: Gamepad = False,
    mapping: Annotated[
        Path | None, typer.Option(metavar="FILE", help="YAML file that says what the gamepad's parts do.")
    ] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Do not open the page in a browser.")] = False,
    json: options.Json = False,
) -> None:
    """Fly by hand: a page in the browser with the camera's picture, the helm, and what the thrusters do to the target.

    Ctrl-C ends the flight. Each flight leaves a folder like any other trial, from which `wakewise scan --resume` makes
    photographs, model and report.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise cockpit", "cockpit")
    from wakewise.operation import load_scenario
    from wakewise.ui.cockpit.server import CockpitServer
    from wakewise.ui.cockpit.session import CockpitSession
    from wakewise.ui.web.origin_check import is_loopback, origin_of

    origins = tuple(origin_of(text) for text in origin or ())
    changes = options.overrides(sets, seed=seed, vehicle=vehicle, target=target, target_size=target_size, world=world)
    resolved = load_scenario(preset, scenario, changes)
    folder = out or options.default_folder(resolved, "cockpit")
    with ExitStack() as stack:
        device = stack.enter_context(_gamepad(mapping)) if gamepad or mapping is not None else None
        session = CockpitSession(resolved, folder, device=device, scene=is_loopback(host))
        server = CockpitServer(session, host, port, origins=origins)
        server.start()
        stack.callback(server.stop)
        stack.callback(session.stop)
        try:
            session.start()
            _say(f"cockpit: {' or '.join(server.addresses)} (Ctrl-C ends the flight)")
            if not no_browser:
                _open(server.address)
            _watch(session)
        except KeyboardInterrupt:  # how a flight by hand ends
            _say("ending the flight")
    if session.fault is not None:
        raise session.fault
    for kept in session.flown:
        _say(f"kept: {kept}")
    if json:
        print_json({"address": server.address, "flights": [str(kept) for kept in session.flown]})


def _watch(session: CockpitSession) -> None:
    """Say what is being prepared, until the session is over."""
    began_s, told = time.monotonic(), None
    from wakewise.core.jit.precompile import is_warm

    if is_warm(("plan", "fly")):
        _say("the first light takes about ten seconds")
    else:
        _say("kernels are compiled first, this time only: some minutes")
    while session.running:
        if session.preparing != told:
            told = session.preparing
            _say(f"  {time.monotonic() - began_s:5.1f} s  {told or 'first light'}")
        time.sleep(_LOOK_S)


@contextmanager
def _gamepad(mapping: Path | None) -> Iterator[ControlSource]:
    """The gamepad at this computer; refused where all there is is one that the mapping is not for."""
    from wakewise.operation.teleop.input.gamepad import Gamepad
    from wakewise.operation.teleop.input.pad_mapping import load_mapping

    with Gamepad(None if mapping is None else load_mapping(mapping)) as pad:
        pad.check()
        yield pad


def _open(address: str) -> None:
    """Open the page where there is a screen to open it on."""
    import os
    import webbrowser

    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return
    webbrowser.open(address)


def _say(line: str) -> None:
    typer.echo(line, err=True)
