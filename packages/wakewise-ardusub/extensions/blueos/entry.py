"""The meter in a BlueOS container: what is set in the extension's environment becomes its options.

WAKEWISE_VEHICLE    a craft file's name: bluerov2-heavy (default), bluerov2, or one that lies in /data
WAKEWISE_CONNECTION udpin:0.0.0.0:14770 (default), where a MAVLink endpoint of BlueOS sends to
WAKEWISE_AHEAD      metres from the bow to the target (default 0.4)
WAKEWISE_OPTIONS    further options of `python3 -m wakewise_ardusub.wash_meter.embedded`; "--ask" if not set

A file /data/vehicle.params, where there is one, says the autopilot's parameters. The page listens at 0.0.0.0, which in
a container is what BlueOS forwards to: whoever reaches BlueOS reaches the page, and BlueOS itself asks for no token.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path

DATA, OWN = Path("/data"), Path(__file__).with_name("craft")
PARAMETERS = "vehicle.params"


def options(environment: Mapping[str, str], data: Path = DATA) -> list[str]:
    """Options for the meter."""
    name = environment.get("WAKEWISE_VEHICLE", "") or "bluerov2-heavy"
    craft = next((folder / f"{name}.json" for folder in (data, OWN) if (folder / f"{name}.json").is_file()), None)
    known = data / PARAMETERS
    return [
        "--craft", str(craft or data / f"{name}.json"),
        "--connection", environment.get("WAKEWISE_CONNECTION", "") or "udpin:0.0.0.0:14770",
        "--ahead", environment.get("WAKEWISE_AHEAD", "") or "0.4",
        "--host", "0.0.0.0", "--port", "8765", "--no-token",
        *(["--params", str(known)] if known.is_file() else []),
        *shlex.split(environment.get("WAKEWISE_OPTIONS", "--ask")),
    ]  # fmt: skip


if __name__ == "__main__":
    from wakewise_ardusub.wash_meter.embedded import main

    sys.exit(main(options(os.environ)))
