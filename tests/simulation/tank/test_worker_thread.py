"""Work beside the one who asked for it: in order, with its errors, and without changing a byte."""

import threading
import time

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Mesh, place_on_bed
from wakewise.simulation.tank import Tank, TankSettings
from wakewise.simulation.tank import tank as module
from wakewise.simulation.tank.tank import WorkerThread

CORNERS = np.array([[0.07, 0.07, 0], [-0.07, 0.07, 0], [-0.07, -0.07, 0], [0.07, -0.07, 0], [0, 0, 0.15]])
PYRAMID = place_on_bed(
    "pyramid", Mesh(CORNERS, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]])), 1.5
)


@pytest.mark.parametrize("cores", [1, 2])
def test_work_is_done_in_order(monkeypatch, cores):
    """Of many pieces each comes after the one before, on one core at once and on two on another thread."""
    monkeypatch.setattr(module, "cores", lambda: cores)
    done, where = [], set()
    beside = WorkerThread("order")

    def piece(k):
        time.sleep(0.001 * (k % 3))
        done.append(k)
        where.add(threading.get_ident())

    for k in range(12):
        beside.do(lambda k=k: piece(k))
    beside.wait()
    assert done == list(range(12))
    assert (where == {threading.get_ident()}) == (cores == 1)


@pytest.mark.parametrize("cores", [1, 2])
def test_an_error_comes_out(monkeypatch, cores):
    """What a piece raises is raised to the one who asked, once, and no later piece hides it."""
    monkeypatch.setattr(module, "cores", lambda: cores)
    beside = WorkerThread("errors")

    def ask():
        beside.do(lambda: 1 / 0)
        beside.do(lambda: None)
        beside.wait()

    with pytest.raises(ZeroDivisionError):
        ask()
    beside.wait()


def test_a_tank_gives_the_same_bytes_on_one_core_and_on_two(monkeypatch):
    """State, water, silt and measures are the same whether water and silt run beside the vehicle or after it."""
    vehicle, records = load_vehicle("paper"), []
    for cores in (1, 2):
        monkeypatch.setattr(module, "cores", lambda cores=cores: cores)
        start = BodyState(X_WB=Pose(np.array([0.0, 0.0, 1.0])))
        settings = TankSettings(silt={"load_kg_m2": 1.0})
        tank = Tank(vehicle, PYRAMID, settings, start, np.random.default_rng(3))
        thrusts, told = vehicle.null_space @ np.full(vehicle.null_space.shape[1], 6.0), []
        for k in range(110):
            tank.step(thrusts, 0.02)
            if k % 20 == 7:
                told.append([tank.measure().target_speed_mean_m_s, tank.measure().ray_optical_depth])
        parts = [tank.state.X_WB.p_m, tank.silt.position_m, tank.water.parcels.position_m, np.array(told)]
        records.append(b"".join(np.ascontiguousarray(part).tobytes() for part in parts))
        assert len(tank.silt.mass_kg) > 0
    assert records[0] == records[1]
