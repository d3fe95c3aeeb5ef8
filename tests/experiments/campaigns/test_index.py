"""The index is a cache: it says what the trials' folders say, whatever has become of it."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from wakewise.experiments.campaigns import attempt_log
from wakewise.experiments.campaigns.index import INDEX, listing
from wakewise.experiments.campaigns.store import FIGURES, CampaignStore, open_store, write_figures


def _folder(tmp_path: Path, count: int) -> CampaignStore:
    """A store with so many trials; a third of them failed, one in seven is not ended."""
    store = open_store(tmp_path / "c")
    for number in range(count):
        place = store.place(f"{number:032x}")
        place.mkdir()
        lines = ['{"event": "begun"}']
        if number % 3 == 0:
            lines.append('{"event": "ended", "how": "error", "reason": "no", "took_s": 1}')
        elif number % 7:
            lines.append('{"event": "ended", "how": "done", "reason": null, "took_s": 1}')
            (place / FIGURES).write_text(json.dumps({"figures": {"a": number, "b": "word"}, "took_s": 1.0}))
        (place / attempt_log.ATTEMPTS).write_text("\n".join(lines) + "\n")
    return store


def test_it_says_what_the_folders_say(tmp_path: Path) -> None:
    """Figures of the finished, reasons of the failed, attempts of all; from folders and from the cache alike."""
    store = _folder(tmp_path, 20)
    read = listing(store)
    assert read[f"{1:032x}"].figures == {"a": 1, "b": "word"}
    assert (read[f"{3:032x}"].figures, read[f"{3:032x}"].attempts.reason) == (None, "no")
    assert read[f"{7:032x}"].attempts.how is None
    again = listing(store)
    assert {key: (one.figures, one.attempts.how, one.took_s) for key, one in again.items()} == {
        key: (one.figures, one.attempts.how, one.took_s) for key, one in read.items()
    }


def test_what_changes_is_read_anew(tmp_path: Path) -> None:
    """A trial that is finished, is added, or goes away after the cache was written."""
    store = _folder(tmp_path, 9)
    listing(store)
    write_figures(store.place(f"{7:032x}"), {"a": 70.0}, 2.0)
    write_figures(store.place(f"{50:032x}"), {"a": 50.0}, 2.0)
    store.forget(f"{1:032x}")
    read = listing(store)
    assert read[f"{7:032x}"].figures == {"a": 70.0}
    assert read[f"{50:032x}"].figures == {"a": 50.0}
    assert f"{1:032x}" not in read


@pytest.mark.parametrize("content", [b"", b"PAR1", b"nothing of the kind", None])
def test_a_damaged_cache_costs_time_only(tmp_path: Path, content: bytes | None) -> None:
    """It is written anew from the folders."""
    store = _folder(tmp_path, 5)
    before = listing(store)
    path = store.folder / INDEX
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)
    assert listing(store).keys() == before.keys()
    assert path.stat().st_size > 100


def test_a_cache_of_another_version_is_not_believed(tmp_path: Path) -> None:
    """Columns that are not ours are none."""
    import polars as pl

    store = _folder(tmp_path, 5)
    pl.DataFrame({"key": ["x"], "figures": ["{}"]}).write_parquet(store.folder / INDEX)
    assert len(listing(store)) == 5


def test_ten_thousand_trials_are_listed_in_a_second(tmp_path: Path) -> None:
    """Of processor time, once they are in the cache."""
    store = _folder(tmp_path, 10_000)
    listing(store)
    began = time.process_time()
    assert len(listing(store)) == 10_000
    assert time.process_time() - began < 1.0
