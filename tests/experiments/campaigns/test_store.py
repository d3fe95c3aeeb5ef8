"""A campaign's folder holds what is finished, and is refused where it holds something else."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cheap
import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.store import (
    FIGURES,
    open_store,
    plain_figures,
    read_figures,
    read_store,
    write_figures,
)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    """Figures and how long they took; nothing of a trial that is not finished."""
    store = open_store(tmp_path / "c")
    task = cheap.adding(1)[0]
    assert store.figures(task.key) is None
    assert store.outcome(task).reason == "not finished"
    write_figures(store.place(task.key), {"speed": np.float64(0.5), "good": True, "what": "word", "none": None}, 1.25)
    assert read_figures(store.place(task.key)) == ({"speed": 0.5, "good": 1.0, "what": "word", "none": None}, 1.25)
    assert store.outcome(task).figures == store.figures(task.key)
    store.forget(task.key)
    assert store.figures(task.key) is None


def test_what_is_not_finite_is_none() -> None:
    """JSON has no word for it."""
    assert plain_figures({"a": math.nan, "b": math.inf, "c": 1}) == {"a": None, "b": None, "c": 1.0}


def test_what_is_neither_number_nor_word_is_refused() -> None:
    """A figure is one value."""
    with pytest.raises(TypeError):
        plain_figures({"a": [1.0, 2.0]})


def test_another_format_is_refused_in_a_line(tmp_path: Path) -> None:
    """Rather than read as if it were ours."""
    open_store(tmp_path / "c")
    (tmp_path / "c" / "store.json").write_text(json.dumps({"format": 99}))
    for opened in (open_store, read_store):
        with pytest.raises(InputError, match="results of format 99, this Wakewise reads 1; give another folder"):
            opened(tmp_path / "c")


@pytest.mark.parametrize("text", ["", "[]", "{}", "nothing"])
def test_a_damaged_store_is_told_of(tmp_path: Path, text: str) -> None:
    """With what is missing."""
    open_store(tmp_path / "c")
    (tmp_path / "c" / "store.json").write_text(text)
    with pytest.raises(InputError, match="must say the format"):
        open_store(tmp_path / "c")


def test_a_folder_of_something_else_is_let_be(tmp_path: Path) -> None:
    """No campaign is begun among other people's files, or in a file."""
    (tmp_path / "holiday.jpg").touch()
    with pytest.raises(InputError, match="holds something that is no campaign"):
        open_store(tmp_path)
    with pytest.raises(InputError, match="is a file"):
        open_store(tmp_path / "holiday.jpg")
    with pytest.raises(InputError, match="no campaign is there"):
        read_store(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.jpg"]


@pytest.mark.parametrize("text", ["", "{}", '{"figures": 3, "took_s": 1}', '{"figures": {}}', "\x00"])
def test_damaged_figures_are_none(tmp_path: Path, text: str) -> None:
    """The trial is made anew."""
    (tmp_path / FIGURES).write_text(text)
    assert read_figures(tmp_path) is None
