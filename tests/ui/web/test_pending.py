"""Connections that have not said who they are: bounded, and never in the way of the next one."""

from __future__ import annotations

import pytest

from wakewise.ui.web.origin_check import PendingConnections


class Line:
    """Connections by number of arrival, and which were closed."""

    def __init__(self, per_address: int, in_all: int) -> None:
        self.pending = PendingConnections(per_address, in_all)
        self.closed: list[str] = []

    def comes(self, address: str, name: str) -> int:
        return self.pending.enter(address, lambda: self.closed.append(name))


def test_of_one_address_the_one_that_waited_longest_makes_room() -> None:
    """The newest is never the one that is closed; other addresses are left alone."""
    line = Line(per_address=3, in_all=100)
    line.comes("10.0.0.9", "other")
    for k in range(10):
        line.comes("10.0.0.1", f"a{k}")
    assert line.closed == [f"a{k}" for k in range(7)]
    assert len(line.pending) == 4


def test_of_many_addresses_the_one_with_most_makes_room() -> None:
    """A crowd from one place cannot push out the only one from another, even if that came first."""
    line = Line(per_address=50, in_all=60)
    line.comes("10.0.0.9", "pilot")
    for k in range(40):
        line.comes("10.0.0.1", f"a{k}")
    for k in range(40):
        line.comes("10.0.0.2", f"b{k}")
    assert len(line.pending) == 60
    assert "pilot" not in line.closed
    assert {name[0] for name in line.closed} == {"a", "b"}


def test_who_has_said_who_it_is_waits_no_more() -> None:
    """It is neither counted nor closed, and leaving twice is no fault."""
    line = Line(per_address=2, in_all=10)
    number = line.comes("10.0.0.1", "named")
    line.pending.leave(number)
    line.pending.leave(number)
    for k in range(3):
        line.comes("10.0.0.1", f"a{k}")
    assert line.closed == ["a0"]
    line.pending.close()
    assert sorted(line.closed) == ["a0", "a1", "a2"]
    assert len(line.pending) == 0


@pytest.mark.parametrize(
    ("one", "other", "alike"),
    [
        ("2001:db8:1:2::1", "2001:db8:1:2:ffff::9", True),
        ("2001:db8:1:2::1", "2001:db8:1:3::1", False),
        ("::ffff:10.0.0.1", "10.0.0.1", True),
        ("fe80::1%eth0", "fe80::2%eth0", True),
        ("10.0.0.1", "10.0.0.2", False),
    ],
)
def test_one_computer_with_many_addresses_counts_as_one(one: str, other: str, alike: bool) -> None:
    """An IPv6 host may take any of the addresses of its network."""
    line = Line(per_address=1, in_all=10)
    line.comes(one, "one")
    line.comes(other, "other")
    assert line.closed == (["one"] if alike else [])
