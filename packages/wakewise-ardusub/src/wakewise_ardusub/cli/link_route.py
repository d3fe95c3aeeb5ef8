"""`wakewise link route`: MAVLink router of one autopilot for several programs."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import Annotated

import typer

from wakewise.ui.cli.console import print_json, status_line
from wakewise.ui.cli.options import Json

VEHICLE = "udpin:127.0.0.1:14540"
OUTS = ("udpout:127.0.0.1:14550", "udpout:127.0.0.1:14560", "udpout:127.0.0.1:14570")
LINE_S = 1.0


def route(
    connection: Annotated[
        str, typer.Option(metavar="PLACE", help="Where the autopilot is: udpin or udpout:HOST:PORT.")
    ] = VEHICLE,
    out: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PLACE",
            help="Who shares it; may be repeated. udpout:127.0.0.1 at 14550 (ground station), 14560 (companion) and "
            "14570 (`wakewise link sitl`) if not given.",
        ),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="End by itself after so long.")] = None,
    json: Json = False,
) -> None:
    """Share an autopilot's MAVLink among several programs over UDP, until Ctrl-C: a router without settings.

    What comes from one goes to all others as it is. On a vehicle, BlueOS's MAVLink Endpoints do this.
    """
    from wakewise_ardusub.link.connection import parse_connection
    from wakewise_ardusub.link.mavlink_relay import MavlinkRouter

    places = [parse_connection(connection), *(parse_connection(each, "--out") for each in out or OUTS)]
    shared = MavlinkRouter(places)
    typer.echo(f"shares {places[0].words} with {', '.join(place.words for place in places[1:])}", err=True)
    end_s = None if seconds is None else time.monotonic() + seconds
    next_s = time.monotonic() + LINE_S

    def line() -> str:
        return ", ".join(f"{place.port}: {count}" for place, count in zip(places, shared.passed, strict=True))

    def going() -> bool:
        nonlocal next_s
        now_s = time.monotonic()
        if now_s >= next_s and sys.stderr.isatty():
            status_line(f"datagrams from {line()}")
            next_s = now_s + LINE_S
        return end_s is None or now_s < end_s

    with suppress(KeyboardInterrupt):
        shared.run(going)
    shared.close()
    counts = {place.words: count for place, count in zip(places, shared.passed, strict=True)}
    if json:
        print_json({"datagrams": counts, "lost": shared.lost})
    else:
        typer.echo(f"datagrams from {line()}")
