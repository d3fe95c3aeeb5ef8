"""Parts from outside: a maker that fails is named in one line; a fault of our own maker passes as it is."""

import sys

import pytest

from wakewise.core.errors import InputError
from wakewise.core.plugins import make

ORIGIN = "theirs_of_test:part"


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("def part(given):\n    raise RuntimeError('no\\nwater')", "cannot be made, RuntimeError: no water"),
        ("def part():\n    return 1", "cannot be made, TypeError: part() takes 0 positional arguments"),
        ("part = 1", "cannot be made, TypeError: 'int' object is not callable"),
    ],
)
def test_a_maker_from_outside_that_fails_is_named(source, words, tmp_path, monkeypatch):
    """Whatever it raises becomes an InputError of one line with kind, name, origin and reason."""
    (tmp_path / "theirs_of_test.py").write_text(source)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "theirs_of_test", raising=False)
    with pytest.raises(InputError) as refused:
        make("target", ORIGIN, {}, 1)
    assert str(refused.value).startswith(f"target '{ORIGIN}': {words}")
    assert "\n" not in str(refused.value)


def test_memory_that_runs_out_is_no_fault_of_a_part(tmp_path, monkeypatch):
    """It keeps its type, as in a flight."""
    (tmp_path / "theirs_of_test.py").write_text("def part():\n    raise MemoryError")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "theirs_of_test", raising=False)
    with pytest.raises(MemoryError):
        make("target", ORIGIN, {})


def test_a_fault_of_our_own_maker_passes_as_it_is():
    """What is ours is not blamed on the input: the error keeps its type and its trace."""

    def ours(given):
        raise ZeroDivisionError(given)

    with pytest.raises(ZeroDivisionError, match="1"):
        make("target", "ours", {"ours": ours}, 1)
    assert make("target", "good", {"good": lambda given: given + 1}, 1) == 2
