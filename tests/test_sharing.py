"""Tests are shared among processes a folder at a time, and what waits is run beside the rest."""

from pathlib import Path

from sharing import BESIDE, LONGEST, next_file

LEFT = [
    "tests/ui/cli/test_a.py",
    "tests/simulation/tank/deep/test_b.py",
    "tests/simulation/tank/test_c.py",
    "tests/test_alone.py",
    "tests/wake/test_d.py",
]


def test_what_is_said_to_wait_is_there() -> None:
    """Each file and folder of the list."""
    root = Path(__file__).parents[1]
    assert [place for place in (*BESIDE, LONGEST) if not (root / place).exists()] == []


def test_a_process_stays_in_its_folder_then_enters_another_then_helps() -> None:
    """Its own folder first, however deep the file; then the first that nobody entered; then the fullest, backwards."""
    assert (
        next_file(LEFT, {"tests/ui/cli", "tests/simulation/tank"}, "tests/simulation/tank", None)
        == "tests/simulation/tank/deep/test_b.py"
    )
    assert (
        next_file(LEFT, {"tests/ui/cli", "tests/simulation/tank"}, "packages/wakewise-ardusub/tests/wash_meter", None)
        == "tests/test_alone.py"
    )
    everywhere = {"tests/ui/cli", "tests/simulation/tank", "tests/test_alone.py", "tests/wake"}
    assert (
        next_file(LEFT, everywhere, "packages/wakewise-ardusub/tests/wash_meter", None)
        == "tests/simulation/tank/test_c.py"
    )
    assert next_file([], everywhere, "packages/wakewise-ardusub/tests/wash_meter", None) is None


def test_the_longest_file_is_begun_first() -> None:
    """By whoever comes first, but not by the process for what waits."""
    left = [*LEFT, LONGEST]
    assert (
        next_file(left, {"tests/simulation/tank"}, "tests/simulation/tank", None)
        == next_file(left, set(), None, waiter=False)
        == LONGEST
    )
    assert next_file(left, set(), None, waiter=True) == "tests/test_alone.py"


def test_what_waits_has_a_process_of_its_own_and_is_never_left_over() -> None:
    """That process runs nothing else; the others run it only when nothing else is left."""
    assert next_file(LEFT, set(), None, waiter=True) == "tests/test_alone.py"
    assert next_file(LEFT[:3], set(), None, waiter=True) is None
    assert next_file(LEFT[3:], {"tests/wake"}, "tests/ui/cli", waiter=False) == "tests/wake/test_d.py"
    assert next_file(LEFT[3:4], {"tests/test_alone.py"}, "tests/wake", waiter=False) == "tests/test_alone.py"
