"""The script that runs on the autopilot, as it is shipped: `wakewise.lua`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.core.files import write_text

SCRIPT_NAME = "wakewise.lua"
SCRIPT_FOLDERS = ("/APM/scripts", "./scripts")
"""Where ArduPilot looks for scripts (AP_Scripting, lua_common_defs.h): on a card, and where it runs on Linux, as on a
Navigator board; BlueOS shows that folder as `lua_scripts`."""
PARAMETERS_NAME, SITL_NAME = "wakewise.params", "sitl.params"
BY_HAND = (
    "BlueOS, File Browser, folder lua_scripts: upload wakewise.lua (elsewhere: folder APM/scripts of the autopilot's "
    "card)",
    "set SCR_ENABLE to 1 and reboot the autopilot",
)
"""What to do where no upload is possible."""


def script_text() -> str:
    """The script as text."""
    return (files(__package__) / SCRIPT_NAME).read_text(encoding="utf-8")


def parameters_text() -> str:
    """What an autopilot is to be set to and why, as ground stations read it."""
    return (files(__package__) / PARAMETERS_NAME).read_text(encoding="utf-8")


def write_script(folder: Path) -> Path:
    """Write the script into a folder, and say where.

    Raises
    ------
    InputError
        If the folder is a file.
    """
    return _write(folder, SCRIPT_NAME, script_text())


def write_parameters(folder: Path) -> Path:
    """Write the parameter file into a folder, and say where; raises as `write_script`."""
    return _write(folder, PARAMETERS_NAME, parameters_text())


def sitl_text() -> str:
    """The same for ArduSub's simulator, with what is a vehicle's own: frame and depth sensor."""
    return parameters_text() + (files(__package__) / SITL_NAME).read_text(encoding="utf-8")


def write_sitl(folder: Path) -> Path:
    """Write the simulator's parameter file into a folder, and say where; raises as `write_script`."""
    return _write(folder, SITL_NAME, sitl_text())


def _write(folder: Path, name: str, text: str) -> Path:
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: a file is there, a folder is needed")
    write_text(folder / name, text)
    return folder / name
