"""Wash meter for computers with NumPy and pymavlink only: `python -m wakewise_ardusub.wash_meter.embedded`.

A BlueROV2's computer has 32 bits: Numba, SciPy's wheels and the readers of vehicle files are not available. The vehicle
comes from a craft file (`wakewise link wash-meter --vehicle NAME --write FILE` writes one on a larger computer), the
standard library parses the options, and the kernels run as plain Python.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wakewise.core.errors import InputError
from wakewise_ardusub.link.parameters import read_parameter_file
from wakewise_ardusub.vehicle_summary import read_vehicle_summary
from wakewise_ardusub.wash_meter.run import PORT, MeterLoop, MeterSettings
from wakewise_ardusub.wash_savings import bow_ball


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the meter as the options say; 2 where they cannot be used."""
    asked = _options().parse_args(arguments)
    try:
        craft = read_vehicle_summary(asked.craft)
        points = bow_ball(craft.bow_m, craft.camera_z_m, asked.ahead)
        settings = MeterSettings(
            connection=asked.connection,
            host=asked.host,
            port=asked.port,
            token=not asked.no_token,
            system=asked.system,
            publish=asked.publish,
            ask=asked.ask,
            out=asked.out,
        )
        known = {} if asked.params is None else read_parameter_file(asked.params)
        words = f"of a ball {asked.ahead:g} m ahead of the bow"
        work = MeterLoop(settings, craft, points, np.ones(len(points)), words, known, _say)
    except InputError as fault:
        print(f"error: {fault}", file=sys.stderr)
        return 2
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: work.over.set())
    work.run()
    return 0


def _say(line: str) -> None:
    print(line, flush=True)


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m wakewise_ardusub.wash_meter.embedded",
        description="The wash meter, for small computers. It listens to a vehicle and never commands it.",
    )
    parser.add_argument("--connection", required=True, help="udpin:HOST:PORT or udpout:HOST:PORT")
    parser.add_argument("--craft", required=True, type=Path, help="craft file of the vehicle")
    parser.add_argument("--ahead", type=float, default=0.4, help="metres from the bow to the middle of the ball")
    parser.add_argument("--params", type=Path, help="the autopilot's parameters, as QGroundControl saves them")
    parser.add_argument("--host", default="127.0.0.1", help="address that the page is served at")
    parser.add_argument("--port", type=int, default=PORT, help="its port; 0 takes any")
    parser.add_argument("--no-token", action="store_true", help="let everybody look who reaches the page")
    parser.add_argument("--system", type=int, help="the vehicle's MAVLink system id")
    parser.add_argument("--publish", action="store_true", help="send WW_D and WW_SAVED as NAMED_VALUE_FLOAT")
    parser.add_argument("--ask", action="store_true", help="ask the autopilot for its motors' channels and directions")
    parser.add_argument("--out", type=Path, help="folder for the dive's record")
    return parser


if __name__ == "__main__":
    sys.exit(main())
