"""What a pilot looks at who loses it every ten seconds: how near the limits are, and what tripped."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from bottle import Bottle
from wakewise.operation.scenario import Scenario
from wakewise_ardusub.link.engagement_fsm import EngagementInputs, EngagementLimits
from wakewise_ardusub.link.output_gate import FreshnessMargins
from wakewise_ardusub.session.session import ProtectedRegion, VehicleSession


def test_ages_are_those_of_the_last_minute() -> None:
    """Of a hundred looks the one that is far off is left out; what is over its limit is marked."""
    margins = FreshnessMargins()
    assert margins.words(EngagementLimits()) == ""
    margins.observe(EngagementInputs(now_s=0.0))
    assert margins.words(EngagementLimits()) == ""
    for k in range(1000):
        margins.observe(
            EngagementInputs(now_s=0.02 * k, pose_s=0.25 if k % 50 == 0 else 0.05, operator_s=0.04, telemetry_s=0.02)
        )
    assert margins.p99_s() == pytest.approx({"pose": 0.25, "sticks": 0.04, "attitude": 0.02})
    assert margins.words(EngagementLimits()) == "p99 ms pose 250!, sticks 40, attitude 20"


def test_each_trip_is_counted_by_its_kind() -> None:
    """Engaged or ready, a fault is one trip; taking the sticks back and what keeps it from being ready are none."""
    bottle = Bottle()
    assert bottle.engage() == "engaged"
    bottle.gate.press()
    bottle.run(0.5)
    assert not bottle.gate.margins.trips
    bottle.silent.add("pose")
    bottle.run(1.0)
    assert bottle.gate.margins.trips == {"pose": 1}
    bottle.silent.clear()
    bottle.run(1.5)
    assert bottle.gate.press() == "engaged"
    bottle.run(0.5)
    bottle.silent.update({"pose", "sticks"})
    bottle.run(1.0)
    bottle.silent.clear()
    bottle.run(3.0)
    assert bottle.gate.margins.trips.total() == 2
    words = bottle.gate.margins.words(bottle.gate.limits)
    assert "trips 2 (pose 2)" in words or "trips 2 (pose 1, operator 1)" in words


def test_80_columns_show_margins_and_trips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Engaged they come first in the line, before mode, wash and what else may be cut off."""
    bottle = Bottle()
    bottle.engage()
    for silent in ({"pose"}, {"sticks"}):
        bottle.silent = silent
        bottle.run(1.0)
        bottle.silent = set()
        bottle.run(1.5)
        assert bottle.gate.press() == "engaged"
    bottle.run(60.0)
    session = VehicleSession(
        scenario=Scenario(vehicle="bluerov2-heavy"),
        receiving=lambda timeout_s: ((), 0),
        send=lambda name, fields: None,
        folder=tmp_path / "sea",
        spare=ProtectedRegion(),
        session=1,
    )
    session.gate = bottle.gate
    monkeypatch.setattr(session, "live", SimpleNamespace(preparing=None, pace=SimpleNamespace(late_s=lambda: 0.0)))
    shown = session.line()[:79]
    session.journal.close()
    assert shown.startswith("engaged  ")
    assert "p99 ms pose" in shown and "trips 2 (pose 1, operator 1)" in shown
