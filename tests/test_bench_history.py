"""The history of short benchmarks tells what changed, in which direction, and for the same processor only."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tools"))
try:
    import bench_history
finally:
    sys.path.pop(0)


def test_changes_beyond_the_bound_are_told_with_their_direction() -> None:
    """Less time is better, a smaller factor of real time is worse; small changes and missing figures are not told."""
    before = {"allocator.search_us": 4.0, "tank.realtime_factor_one_core": 10.0, "dynamics.step_us": 1.0}
    now = {"allocator.search_us": 3.0, "tank.realtime_factor_one_core": 8.0, "dynamics.step_us": 1.1}
    lines = bench_history.compared(now, before | {"imaging.frame_cpu_s": 1.0})
    assert [line.split(":")[0] for line in lines] == ["allocator.search_us", "tank.realtime_factor_one_core"]
    assert lines[0].endswith("better)") and lines[1].endswith("worse)")


def test_a_slower_checkout_ends_with_1_and_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row of another processor is no peer; the new row is appended with commit and processor."""
    monkeypatch.setattr(bench_history, "HISTORY", tmp_path / "docs" / "history.jsonl")
    monkeypatch.setattr(bench_history, "processor", lambda: "this one")
    monkeypatch.setattr(sys, "argv", ["bench_history.py"])
    codes = []
    for value in (4.0, 4.1, 8.0):
        monkeypatch.setattr(bench_history, "measured", lambda value=value: {"allocator.search_us": value})
        codes.append(bench_history.main())
    assert codes == [0, 0, 1]
    rows = bench_history.read_history()
    assert [row["figures"]["allocator.search_us"] for row in rows] == [4.0, 4.1, 8.0]
    assert all(row["processor"] == "this one" and row["commit"] for row in rows)


def test_what_is_kept_can_be_read() -> None:
    """Each kept row has its date, commit, processor and figures of known names."""
    names = {f"{bench}.{key}" for bench, key, _ in bench_history.FIGURES}
    for row in bench_history.read_history():
        assert {"date", "commit", "processor", "figures"} == set(row)
        assert set(row["figures"]) <= names
