"""Every room's door opens: what it says it offers is there."""

import importlib
import pkgutil

import pytest

import wakewise

ROOMS = [
    module.name
    for module in pkgutil.walk_packages(wakewise.__path__, "wakewise.")
    if module.ispkg and not module.name.startswith("wakewise.reconstruction.nerf")
]


@pytest.mark.parametrize("room", ["wakewise", *ROOMS])
def test_all_that_a_room_offers_is_there(room: str) -> None:
    """`from room import *` works, and no name is offered twice."""
    door = importlib.import_module(room)
    offered = list(getattr(door, "__all__", ()))
    assert [name for name in offered if not hasattr(door, name)] == []
    assert len(offered) == len(set(offered))
