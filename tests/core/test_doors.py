"""Every room's door opens; a lazy one imports its exports when asked, and gives what a plain one would."""

import importlib
import pkgutil
import subprocess
import sys

import pytest

import wakewise
from wakewise.core.lazy_imports import _Door

ROOMS = [
    room.name
    for room in pkgutil.walk_packages(wakewise.__path__, "wakewise.")
    if room.ispkg and isinstance(importlib.import_module(room.name), _Door)
]


def test_the_rooms_with_heavy_libraries_have_lazy_doors():
    """Those that photographs, models, reports and trials are made in."""
    assert {
        "wakewise.vision.imaging",
        "wakewise.vision.reconstruction",
        "wakewise.ui.reports",
        "wakewise.experiments.trials",
    } <= set(ROOMS)


@pytest.mark.parametrize("name", ROOMS)
def test_a_door_gives_what_it_states(name):
    """Every name of `__all__` can be had and is listed by `dir`; what is not there is said as ever."""
    room = importlib.import_module(name)
    assert set(room.__all__) == set(room._homes) <= set(dir(room))
    for export in room.__all__:
        assert getattr(room, export) is not None
    absent = "nothing"
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        getattr(room, absent)
    with pytest.raises(ImportError, match="cannot import name 'nothing'"):
        exec(f"from {name} import nothing")


def test_a_module_below_a_room_does_not_hide_the_export_of_its_name():
    """`imaging.photograph` is the function, whichever is imported first."""
    script = (
        "import wakewise.vision.imaging.photograph\n"
        "from wakewise.vision.imaging import photograph\n"
        "assert callable(photograph), photograph\n"
        "import wakewise.vision.imaging.blur\n"
        "assert wakewise.vision.imaging.blur.__name__ == 'wakewise.vision.imaging.blur'\n"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


EVERY = [
    module.name
    for module in pkgutil.walk_packages(wakewise.__path__, "wakewise.")
    if module.ispkg and not module.name.startswith("wakewise_nerf.field")
]


@pytest.mark.parametrize("room", ["wakewise", *EVERY])
def test_all_that_a_room_offers_is_there(room: str) -> None:
    """`from room import *` works, and no name is offered twice."""
    door = importlib.import_module(room)
    offered = list(getattr(door, "__all__", ()))
    assert [name for name in offered if not hasattr(door, name)] == []
    assert len(offered) == len(set(offered))
