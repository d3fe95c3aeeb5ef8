"""Packages that only some of Wakewise needs, by the name under which pip installs them: `.[photos]` in a clone.

The core plans, flies and measures water without them, and runs where some of them have no wheel. What needs one says
so before it begins (`need`), in one line; rooms say it where they are entered (`wakewise.core.lazy_imports`).
"""

from __future__ import annotations

from importlib.util import find_spec

from wakewise.core.errors import MissingExtra

EXTRAS: dict[str, dict[str, str]] = {
    "photos": {
        "cv2": "opencv-python-headless",
        "embreex": "embreex",
        "small_gicp": "small-gicp",
        "pycolmap": "pycolmap",
        "PIL": "pillow",
    },
    "reports": {"matplotlib": "matplotlib", "viser": "viser", "cv2": "opencv-python-headless", "PIL": "pillow"},
    "cockpit": {"websockets": "websockets", "cv2": "opencv-python-headless", "embreex": "embreex"},
    "gamepad": {"pygame": "pygame-ce"},
    "links": {"pymavlink": "pymavlink", "mcap": "mcap", "lupa": "lupa"},
    "ros": {"rosbags": "rosbags"},
    "logs": {"foxglove": "foxglove-sdk"},
    "nerf": {"torch": "torch"},
    "film": {"av": "av"},
    "dask": {"distributed": "distributed"},
    "gpu": {"numba_cuda": "numba-cuda"},
}
"""Modules of each extra, and the package that each comes with; pyproject.toml says which versions."""


def has(extra: str) -> bool:
    """Whether all of an extra is installed."""
    return all(_is_here(module) for module in EXTRAS[extra])


def need(what: str, *extras: str, only: tuple[str, ...] = ()) -> None:
    """Refuse what cannot be done without extras that are not installed.

    Parameters
    ----------
    what : str
        Who needs them, such as "wakewise scan"; the message begins with it.
    *extras : str
        Keys of `EXTRAS`.
    only : tuple of str, optional
        Modules of the extras that are needed; all if not given.

    Raises
    ------
    MissingExtra
        Names what is missing and how it is installed.
    """
    missing: list[str] = []
    lacking: list[str] = []
    for extra in extras:
        found = [
            package
            for module, package in EXTRAS[extra].items()
            if not (only and module not in only) and not _is_here(module)
        ]
        missing += [package for package in found if package not in missing]
        lacking += [extra] if found else []
    if missing:
        raise MissingExtra(_line(what, missing, lacking))


def missing_extra(what: str, fault: ImportError, *preferred: str) -> MissingExtra | None:
    """The error to raise where an import failed: None if what is missing belongs to no extra.

    Parameters
    ----------
    what : str
        As in `need`.
    fault : ImportError
    *preferred : str
        Extras to name first where several hold the module.
    """
    module = (fault.name or "").partition(".")[0]
    for extra in (*preferred, *EXTRAS):
        if module in EXTRAS[extra]:
            return MissingExtra(_line(what, [EXTRAS[extra][module]], [extra]))
    return None


def _line(what: str, packages: list[str], extras: list[str]) -> str:
    *others, last = packages
    named = f"{', '.join(others)} and {last}" if others else last
    wanted, verb = ",".join(extras), "are" if others else "is"
    return f"{what} needs {named}, which {verb} not installed: {how_to_install(wanted)}"


def _is_here(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):  # blocked, or a stand-in without a spec
        return False


def how_to_install(extras: str) -> str:
    """What to type in the clone's folder for some of the package's extras, parted by commas."""
    return f"pip install -e '.[{extras}]' (in the clone's folder)"
