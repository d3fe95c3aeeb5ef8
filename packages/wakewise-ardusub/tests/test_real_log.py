"""A real vehicle's telemetry log."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("mcap", reason="the extra `links` is not installed")

from wakewise_ardusub.logs.read import read_log
from wakewise_ardusub.logs.table import tabulate

LOG = Path(os.environ.get("WAKEWISE_DATA", "../shared/data")) / "ardusub" / "2023-04-18.tlog"
pytestmark = pytest.mark.skipif(not LOG.is_file(), reason=f"{LOG} is not here: set WAKEWISE_DATA")


def test_the_real_log_comes_in_whole() -> None:
    """All 50,136 good packets and the 1,967 bad ones that pymavlink counts; five minutes on deck, disarmed."""
    log = read_log(LOG)
    assert (log.records, log.bad_records, log.bad) == (50_136, 1_967, {"checksum": 1_967})
    assert (log.cut_short, log.system, log.jumps) == (False, 1, ())
    assert {name: len(series.time_s) for name, series in log.series.items()} == {
        "attitude": 6210, "depth VFR_HUD": 3117, "depth AHRS2": 6210, "armed": 314, "mode": 314, "servo": 627,
        "pressure 1": 627, "pressure 2": 627, "voltage": 898, "sticks": 7463, "altitude": 919,
    }  # fmt: skip
    assert log.duration_s == pytest.approx(316.438, abs=1e-3)
    rows = tabulate(log).rows
    assert rows["armed"].drop_nulls().to_list() == [False] * rows["armed"].drop_nulls().len()
    assert set(rows["mode"].drop_nulls()) == {"MANUAL"}
    assert rows.select([f"servo_{i}_us" for i in range(1, 9)]).drop_nulls().to_numpy().tolist()[0] == [1500.0] * 8
    assert log.parameters["MOT_1_DIRECTION"] == -1.0
