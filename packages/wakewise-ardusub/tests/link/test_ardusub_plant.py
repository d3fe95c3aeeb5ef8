"""The sea as a plant: when a step gives back what was measured, and what becomes of its thrusts."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from wakewise.core.interfaces import Measurement
from wakewise_ardusub.session.vehicle_plant import EARLY, ArduSubPlant


@dataclass
class Around:
    """An output gate and a flight's clock that began at 100 s; waiting takes what is asked for."""

    now_s: float = 100.0
    sent: list = field(default_factory=list)
    waited: list = field(default_factory=list)

    def clock(self):
        return self.now_s

    def due_s(self, time_s):
        return 100.0 + time_s

    def wait(self, seconds):
        self.waited.append(seconds)
        self.now_s += seconds

    def command(self, thrusts_N, entry):
        self.sent.append((thrusts_N.tolist(), entry))

    def measurements(self):
        return (Measurement(time_s=self.now_s - 0.001, depth_m=1.0),)


def plant(around, entry=3):
    return ArduSubPlant(gate=around, clock=around, wait=around.wait, entry=lambda: entry)


def test_measurements_come_shortly_before_the_next_decision_is_due():
    """A tenth of a step early, however long the controller took, and never by waiting backwards."""
    around = Around()
    sea = plant(around)
    for k, took_s in enumerate((0.02, 0.05, 0.15, 0.0)):
        around.now_s += took_s
        (found,) = sea.step(np.ones(8), 0.1)
        due_s = 0.1 * (k + 1)
        late_s = max(around.now_s - 100.0 - (due_s - EARLY * 0.1), 0.0)
        assert found.time_s == pytest.approx(due_s - EARLY * 0.1 + late_s - 0.001)
        around.now_s = max(around.now_s, 100.0 + due_s)  # the loop's pace waits for the rest
    assert all(seconds > 0.0 for seconds in around.waited)


def test_thrusts_go_to_the_output_gate_only_in_an_engagement():
    """With the engagement that they were decided in; none without one."""
    around = Around()
    plant(around).step(np.full(8, 2.0), 0.1)
    plant(around, entry=None).step(np.full(8, 2.0), 0.1)
    assert around.sent == [([2.0] * 8, 3)]
