"""A session from its scenario to the folders of its flights, in the paper's own water, which costs least."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.operation import Scenario
from wakewise.ui.cockpit.session import CockpitSession

STATE = (
    "time_s", "mode", "settings", "controls", "thrusts_N", "commanded_m_s", "velocity_m_s", "deviation_pct",
    "disturbance", "direct_disturbance", "rms_m_s", "direct_rms_m_s", "saved_pct", "predicted_m_s", "true_m_s",
    "depth_m", "roll_deg", "pitch_deg", "heading_deg",
    "tilt_deg", "power_W", "energy_J", "position_W_m", "goal_W_m", "coverage", "photos", "loop", "fallback", "target",
)  # fmt: skip


class Hands:
    """A page's holder of the helm, who sends sticks whenever something is waited for."""

    def __init__(self, session: CockpitSession) -> None:
        self.session, self.seq, self.axes, self.said = session, 0, np.zeros(5), [""]
        session.mailbox.ask("me")

    @property
    def lease(self) -> str:
        return self.session.mailbox.holding.lease or ""

    def until(self, right: Callable[[], object], within_s: float = 60.0) -> None:
        end_s = time.monotonic() + within_s
        while not right():
            assert time.monotonic() < end_s, self.said
            if self.session.mailbox.holding.holder != "me":
                self.session.mailbox.ask("me")
            self.seq += 1
            self.session.mailbox.moved("me", self.lease, self.seq, 1e3 * time.monotonic(), self.axes)
            self.said += [note.text for note in self.session.notes()]
            time.sleep(0.04)

    def press(self, what: str) -> None:
        assert self.session.mailbox.press("me", self.lease, what)

    @property
    def state(self) -> dict[str, Any]:
        return self.session.state() or {}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[CockpitSession, Hands, Path]]:
    """A session that flies, with hands at its helm."""
    folder = tmp_path_factory.mktemp("cockpit") / "flight"
    scenario = Scenario.preset("quick", world="paper").replace(**{"target.points": 60})
    session = CockpitSession(scenario, folder, pictures=False)
    assert session.welcome()["preparing"]
    session.start()
    hands = Hands(session)
    hands.until(lambda: session.flying, within_s=300.0)  # kernels may be cold
    yield session, hands, folder
    session.stop()
    assert not session.running


def test_a_state_has_all_that_the_wire_promises(flown: tuple[CockpitSession, Hands, Path]) -> None:
    """Every key is there, numbers are JSON's, and per-point arrays are as long as the target's points."""
    session, hands, _ = flown
    hands.until(lambda: hands.state.get("true_m_s"))
    state = hands.state
    assert set(STATE) <= set(state)
    json.dumps(state, allow_nan=False)
    welcome = session.welcome()
    points = len(welcome["target"]["points_W_m"])
    assert points <= 300
    assert len(state["predicted_m_s"]) == len(state["true_m_s"]) == points
    assert len(state["thrusts_N"]) == len(welcome["vehicle"]["thrusters"]) == 8
    assert welcome["preparing"] is None
    assert welcome["settings"]["ranges"]["w_track"] == [0.5, 50.0]
    json.dumps(welcome, allow_nan=False)


def test_without_pictures_no_target_is_designated(flown: tuple[CockpitSession, Hands, Path]) -> None:
    """It is refused in words, and the state has no target."""
    session, hands, _ = flown
    with pytest.raises(InputError, match="no pictures are drawn"):
        session.designate((0.4, 0.4, 0.6, 0.6), 1)
    with pytest.raises(InputError, match="no pictures are drawn"):
        session.propose("ask")
    assert hands.state["target"] is None


def test_sticks_move_the_vehicle_and_the_deviation_is_told(flown: tuple[CockpitSession, Hands, Path]) -> None:
    """As operator, a stick to the right becomes a velocity to the right, and its wait is measured."""
    _, hands, _ = flown
    hands.press("operator")
    hands.axes = np.array([0.0, 0.8, 0.0, 0.0, 0.0])
    hands.until(lambda: hands.state["commanded_m_s"][1] > 0.05)
    hands.until(lambda: hands.state["velocity_m_s"][1] > 0.02)
    state = hands.state
    assert state["mode"] == "operator"
    assert state["controls"][1] == pytest.approx(0.8)
    assert state["deviation_pct"] is not None
    assert state["loop"]["stick_to_thrust_ms_p99"] is not None
    hands.axes = np.zeros(5)


def test_a_photograph_is_counted_and_guided(flown: tuple[CockpitSession, Hands, Path]) -> None:
    """It is said, counted, and the guide says where to go next."""
    _, hands, _ = flown
    hands.press("capture")
    hands.until(lambda: hands.state["photos"] == 1)
    hands.until(lambda: any("photograph 1" in line for line in hands.said))
    coverage = hands.state["coverage"]
    assert 0.0 <= coverage["share"] <= 1.0
    assert coverage["next"]["words"]


def test_a_stop_leaves_a_trial_folder_and_another_flight_may_begin(flown: tuple[CockpitSession, Hands, Path]) -> None:
    """The folder is whole; between flights there is no state; the next flight gets a folder of its own."""
    session, hands, folder = flown
    hands.press("stop")
    hands.until(lambda: session.flown == [folder])
    hands.until(lambda: session.preparing and "another" in session.preparing)
    assert session.state() is None
    # How many steps an overloaded computer makes in these seconds is not told here.
    assert pl.read_parquet(folder / "steps.parquet").height > 10
    assert (folder / "scenario.yaml").exists()
    hands.press("hold")
    hands.until(lambda: session.flying)
    assert hands.state["photos"] == 0
    session.stop()
    assert session.flown == [folder, folder.with_name("flight-2")]
    assert session.fault is None
