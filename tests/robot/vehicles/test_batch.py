"""Many vehicles at once: each is stepped as one alone, to the last bit."""

import numba
import numpy as np
import pytest
from moving_vehicles import ALL_VEHICLES, random_state, vehicle_named

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import compile_body, pack_bodies, step_batch, step_rk4
from wakewise.robot.vehicles.batch import BLOCK, batch_kernel

N = BLOCK + 5
"""One whole block and part of another."""


@pytest.fixture(scope="module")
def fleet():
    """Bodies of all vehicles in turn, random states, wrenches and currents."""
    rng = np.random.default_rng(3)
    bodies = [compile_body(vehicle_named(name)) for name in ALL_VEHICLES]
    bodies = [bodies[k % len(bodies)] for k in range(N)]
    states = np.array([np.concatenate(random_state(rng)) for _ in range(N)])
    wrenches = np.array([body.mass_matrix @ rng.normal(size=6) for body in bodies])
    return bodies, states, wrenches, 0.3 * rng.normal(size=(N, 3))


def one_by_one(bodies, states, wrenches, currents, dt_s, steps=1):
    out = states.copy()
    for row, body, wrench, current in zip(out, bodies, wrenches, currents, strict=True):
        for _ in range(steps):
            row[:] = np.concatenate(step_rk4(body, row[:3], row[3:7], row[7:], wrench, current, dt_s))
    return out


def test_a_batch_of_different_vehicles_is_each_of_them_alone(fleet):
    """Own body, wrench and current for every vehicle, three steps: the same bits, and the states given are kept."""
    bodies, states, wrenches, currents = fleet
    given = states.copy()
    got = step_batch(pack_bodies(bodies), states, wrenches, 0.01, currents_W_m_s=currents, steps=3)
    assert np.array_equal(got, one_by_one(bodies, states, wrenches, currents, 0.01, 3))
    assert np.array_equal(states, given)


def test_one_body_serves_all_and_water_is_still_if_not_given(fleet):
    """A record in place of rows, no current, and states changed in place."""
    bodies, states, wrenches, _ = fleet
    wanted = one_by_one([bodies[0]] * N, states, wrenches, np.zeros((N, 3)), 0.01)
    now = states.copy()
    assert step_batch(bodies[0], now, wrenches, 0.01, out=now) is now
    assert np.array_equal(now, wanted)


def test_one_current_serves_all(fleet):
    """A single row is the water round every vehicle."""
    bodies, states, wrenches, currents = fleet
    got = step_batch(bodies[0], states, wrenches, 0.01, currents_W_m_s=currents[0])
    assert np.array_equal(got, one_by_one([bodies[0]] * N, states, wrenches, [currents[0]] * N, 0.01))


def test_bytes_do_not_depend_on_threads(fleet):
    """One thread and two give the same states."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("this machine has one core")
    bodies, states, wrenches, currents = fleet
    packed, before, got = pack_bodies(bodies), numba.get_num_threads(), []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            got.append(step_batch(packed, states, wrenches, 0.01, currents_W_m_s=currents, steps=20).tobytes())
    finally:
        numba.set_num_threads(before)
    assert got[0] == got[1]


def test_any_array_will_do_and_nothing_is_compiled_again(fleet):
    """Lists, read-only, strided and float32 arrays give what plain ones give, through one compiled kernel."""
    bodies, states, wrenches, _ = fleet
    wanted = step_batch(bodies[0], states, wrenches, 0.01)
    locked, strided = wrenches.copy(), np.asfortranarray(states)
    locked.setflags(write=False)
    assert np.array_equal(step_batch(bodies[0], strided, locked, 0.01), wanted)
    assert np.array_equal(step_batch(bodies[0], states.tolist(), wrenches.tolist(), 0.01), wanted)
    rounded = wrenches.astype(np.float32)
    assert np.array_equal(
        step_batch(bodies[0], states, rounded, 0.01), step_batch(bodies[0], states, rounded.astype(float), 0.01)
    )
    assert len(batch_kernel.signatures) == 1


def test_what_does_not_fit_is_refused(fleet):
    """Each message has the name, the shape that came and the one that is needed."""
    bodies, states, wrenches, currents = fleet
    body = bodies[0]
    for said, call in {
        r"states: shape \(13,\)": lambda: step_batch(body, states[0], wrenches, 0.01),
        r"wrenches_B: shape \(69, 3\), allowed \(69, 6\)": lambda: step_batch(body, states, currents, 0.01),
        r"currents_W_m_s: shape \(2, 3\), allowed": lambda: step_batch(
            body, states, wrenches, 0.01, currents_W_m_s=currents[:2]
        ),
        r"bodies: shape \(2, 20, 6\)": lambda: step_batch(pack_bodies(bodies[:2]), states, wrenches, 0.01),
        "dt_s: nan": lambda: step_batch(body, states, wrenches, float("nan")),
        "dt_s: 0": lambda: step_batch(body, states, wrenches, 0.0),
        "steps: 0": lambda: step_batch(body, states, wrenches, 0.01, steps=0),
        "out: float32": lambda: step_batch(body, states, wrenches, 0.01, out=states.astype(np.float32)),
        r"out: .*\(68, 13\)": lambda: step_batch(body, states, wrenches, 0.01, out=states[1:].copy()),
        "bodies: none": lambda: pack_bodies([]),
    }.items():
        with pytest.raises(InputError, match=said):
            call()
