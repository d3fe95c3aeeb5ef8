"""Telemetry: another reader finds in log.mcap what was flown."""

import json
from pathlib import Path

import numpy as np
import polars as pl
from mcap.reader import make_reader

from wakewise.operation.recorder import step_columns
from wakewise.operation.telemetry import write_mcap


def test_an_independent_reader_finds_every_topic_and_value(tmp_path: Path) -> None:
    """The mcap package reads the topics, the times and the thrusts that were written."""
    rng = np.random.default_rng(0)
    steps = pl.DataFrame({name: rng.normal(size=20) for name in step_columns(3)}).with_columns(
        time_s=pl.Series(np.arange(20) * 0.02), disturbance=pl.lit(float("nan"))
    )
    write_mcap(steps, tmp_path / "log.mcap", every=5)
    with (tmp_path / "log.mcap").open("rb") as file:
        messages = [(channel.topic, message) for _, channel, message in make_reader(file).iter_messages()]
    topics = {topic for topic, _ in messages}
    assert topics == {"/true/pose", "/estimated/pose", "/goal/pose", "/thrusts", "/water"}
    thrusts = [(m.log_time, json.loads(m.data)) for topic, m in messages if topic == "/thrusts"]
    assert [time for time, _ in thrusts] == [0, 100_000_000, 200_000_000, 300_000_000]
    assert thrusts[1][1]["thrust_2_N"] == steps["thrust_2_N"][5]
    water = [json.loads(m.data) for topic, m in messages if topic == "/water"]
    assert water[0]["disturbance"] is None
