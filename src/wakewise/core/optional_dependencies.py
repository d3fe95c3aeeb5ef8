"""Optional dependencies: which packages each extra installs, and the error that names the missing ones.

The core plans, flies and measures water without them, and runs where some of them have no wheel. What needs one checks
before it begins (`need`); packages check where their names are asked for (`wakewise.core.lazy_imports`). A package
beside the library declares its own extras (entry point `wakewise.optional_dependencies`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
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
    "ros": {"rosbags": "rosbags"},
    "logs": {"foxglove": "foxglove-sdk"},
    "detector": {"onnxruntime": "onnxruntime"},
    "learning": {"gymnasium": "gymnasium"},
    "nerf": {"torch": "torch"},
    "film": {"av": "av"},
    "dask": {"distributed": "distributed"},
    "gpu": {"numba_cuda": "numba-cuda"},
}
"""Modules of each extra, and the package that each comes with; pyproject.toml says which versions."""

_GROUP = "wakewise.optional_dependencies"


@dataclass(frozen=True)
class OptionalDependencies:
    """Extras of one distribution, whose pyproject.toml lies in `folder` of the clone."""

    folder: str
    extras: Mapping[str, Mapping[str, str]]
    """For each extra: modules, and the package that each comes with."""

    def has(self, extra: str) -> bool:
        """Whether all of an extra is installed."""
        return all(_is_here(module) for module in self.extras[extra])

    def need(self, what: str, *extras: str, only: tuple[str, ...] = ()) -> None:
        """Refuse what cannot be done without extras that are not installed.

        The message begins with `what`, such as "wakewise scan". Of the extras' modules `only` those given are needed,
        all if none is.

        Raises MissingExtra that names what is missing and how it is installed.
        """
        missing: list[str] = []
        lacking: list[str] = []
        for extra in extras:
            found = [
                package
                for module, package in self.extras[extra].items()
                if not (only and module not in only) and not _is_here(module)
            ]
            missing += [package for package in found if package not in missing]
            lacking += [extra] if found else []
        if missing:
            raise MissingExtra(self._line(what, missing, lacking))

    def missing_extra(self, what: str, module: str, *preferred: str) -> MissingExtra | None:
        """The error for a missing module; None if it belongs to no extra. `preferred` extras are named first."""
        for extra in (*(name for name in preferred if name in self.extras), *self.extras):
            if module in self.extras[extra]:
                return MissingExtra(self._line(what, [self.extras[extra][module]], [extra]))
        return None

    def how_to_install(self, extras: str) -> str:
        """What to type in the clone's folder for some extras, separated by commas."""
        return f"pip install -e '{self.folder}[{extras}]' (in the clone's folder)"

    def _line(self, what: str, packages: list[str], extras: list[str]) -> str:
        *others, last = packages
        named = f"{', '.join(others)} and {last}" if others else last
        wanted, verb = ",".join(extras), "are" if others else "is"
        return f"{what} needs {named}, which {verb} not installed: {self.how_to_install(wanted)}"


LIBRARY = OptionalDependencies(".", EXTRAS)
has, need, how_to_install = LIBRARY.has, LIBRARY.need, LIBRARY.how_to_install


def missing_extra(what: str, fault: ImportError, *preferred: str) -> MissingExtra | None:
    """The error to raise where an import failed, for extras of the library and of all packages beside it.

    None if what is missing belongs to no extra.
    """
    module = (fault.name or "").partition(".")[0]
    for owner in (LIBRARY, *_beside()):
        refusal = owner.missing_extra(what, module, *preferred)
        if refusal is not None:
            return refusal
    return None


def _beside() -> Iterator[OptionalDependencies]:
    """Extras of the installed packages beside the library."""
    for point in entry_points(group=_GROUP):
        yield point.load()


def _is_here(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):  # blocked, or a stand-in without a spec
        return False
