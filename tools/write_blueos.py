"""Write what the BlueOS extension carries and code knows: craft files of the library's vehicles, and its two logos.

A test fails when any is stale. With --owner ACCOUNT --out DIR it writes what BlueOS's store is to be told instead.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parents[1] / "packages/wakewise-ardusub/extensions" / "blueos"
PLACEHOLDER = "OWNER"
VEHICLES = ("bluerov2", "bluerov2-heavy")
SIZE_PX, FINE = 256, 4
WATER, FOAM, CALM = (11, 111, 130), (255, 255, 255), (247, 200, 89)


def crafts() -> dict[str, str]:
    """Craft files by name, with the wake model that is the meter's own choice."""
    from wakewise.robot.vehicles import load_vehicle
    from wakewise.wake import wake_model
    from wakewise_ardusub.vehicle_summary import VehicleSummary, vehicle_summary_json

    return {
        f"{name}.json": vehicle_summary_json(VehicleSummary.of(load_vehicle(name), wake_model("jet")))
        for name in VEHICLES
    }


def logo(*, needle: bool) -> np.ndarray:
    """Two waves in a rounded square, shape (256, 256, 4); above them, with `needle`, a dial that rests low."""
    n = SIZE_PX * FINE
    y, x = (np.mgrid[0:n, 0:n] + 0.5) / n
    edge = 0.22
    inside = np.hypot(np.maximum(np.abs(x - 0.5) - 0.5 + edge, 0), np.maximum(np.abs(y - 0.5) - 0.5 + edge, 0)) <= edge
    picture = np.zeros((n, n, 4))
    picture[inside] = (*WATER, 255)
    middles = (0.72, 0.86) if needle else (0.375, 0.625)
    for middle in middles:
        wave = middle - 0.055 * np.sin(2.0 * np.pi * (x - 0.16) / 0.68)
        picture[inside & (np.abs(y - wave) < 0.032) & (np.abs(x - 0.5) < 0.34)] = (*FOAM, 255)
    if needle:
        distance, angle = np.hypot(x - 0.5, y - 0.56), np.arctan2(0.56 - y, x - 0.5)
        picture[(np.abs(distance - 0.34) < 0.028) & (angle > 0.0)] = (*FOAM, 255)
        along = (x - 0.5) * np.cos(2.6) - (y - 0.56) * np.sin(2.6)
        across = (x - 0.5) * np.sin(2.6) + (y - 0.56) * np.cos(2.6)
        picture[(along > 0.0) & (along < 0.29) & (np.abs(across) < 0.03 - 0.06 * along)] = (*CALM, 255)
        picture[distance < 0.05] = (*CALM, 255)
    return np.rint(picture.reshape(SIZE_PX, FINE, SIZE_PX, FINE, 4).mean(axis=(1, 3))).astype(np.uint8)


def logos() -> dict[str, np.ndarray]:
    """The extension's and the maker's, by file name."""
    return {"extension_logo.png": logo(needle=True), "company_logo.png": logo(needle=False)}


def metadata(owner: str) -> str:
    """What the store is told, with the account that publishes.

    Raises
    ------
    ValueError
        If that is no account's name, or the word that stands for one.
    """
    if owner == PLACEHOLDER or not re.fullmatch(r"[a-z0-9](?:[a-z0-9-]*[a-z0-9])?", owner):
        raise ValueError(f"--owner {owner!r}: must be the account that publishes, of a-z, 0-9 and -, such as reef-lab")
    return (FOLDER / "metadata.json").read_text(encoding="utf-8").replace(PLACEHOLDER, owner)


def write_store(owner: str, folder: Path) -> None:
    """What goes into the store's repository."""
    text = metadata(owner)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "metadata.json").write_text(text, encoding="utf-8")
    for logo_file in FOLDER.glob("*_logo.png"):
        shutil.copy(logo_file, folder)


def main() -> None:
    """Write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--owner", help="account at Docker Hub and GitHub that publishes the extension")
    parser.add_argument("--out", type=Path, help="folder for the store's files")
    given = parser.parse_args()
    if given.owner is None and given.out is None:
        write_carried()
        return
    if given.owner is None or given.out is None:
        parser.error("--owner and --out go together")
    try:
        write_store(given.owner, given.out)
    except ValueError as fault:
        sys.exit(str(fault))


def write_carried() -> None:
    """What lies in the extension's folder."""
    from PIL import Image

    for name, text in crafts().items():
        (FOLDER / "craft" / name).write_text(text, encoding="utf-8")
    for name, picture in logos().items():
        Image.fromarray(picture).save(FOLDER / name, optimize=True)


if __name__ == "__main__":
    main()
