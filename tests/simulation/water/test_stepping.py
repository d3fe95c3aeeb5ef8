"""The compiled step and the flow it leaves, against the readable sums, and what must not change it."""

import numpy as np
import pytest
from wall_jet_reference import planes_velocity

from wakewise.simulation.water.bedjets import RingBuffers
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.induction import impulse_velocity
from wakewise.simulation.water.water import Water, _with_room

AREAS_M2 = np.full(3, 2.8e-3)
DISKS_M = np.array([[0.0, 0.0, 0.8], [0.3, 0.0, 0.9], [-0.4, 0.0, 0.9]])
AXES = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
GIVEN_N_S = np.array([[0.1, 0.0], [0.06, 0.0], [0.06, 0.0]])


def _water(steps, seed=0, **options):
    water = Water(
        AREAS_M2,
        density_kg_m3=1000.0,
        bed_z_m=1.5,
        rng=np.random.default_rng(seed),
        half_size_m=(1.5, 1.5),
        turbulence=0.25,
        **options,
    )
    for _ in range(steps):
        water.step(0.05, DISKS_M, DISKS_M, AXES, GIVEN_N_S)
    return water


def test_the_flow_is_that_of_its_parts():
    """All jets together are the parcels and their images one by one and the rings, both in double precision, to 1 %."""
    water = _water(160)
    now, points = water.now, np.random.default_rng(1).uniform([-1, -1, 0.6], [1, 1, 1.5], (300, 3))
    room = TankFaces.of(1.5, (1.5, 1.5), surface=True)
    free = impulse_velocity(
        points,
        *room.with_images(now.parcels.position_m, now._field.impulses_m4_s[: now.parcels.count], now.parcels.sigma_m),
        exact=True,
    )
    rows = now._rows
    along = planes_velocity(points, rows.planes, rows.starts, rows.packed, exact=True)
    assert np.sqrt((along**2).mean()) > 1e-3
    error = now.jets(points) - free - along
    assert np.sqrt((error**2).mean()) < 0.01 * np.sqrt((free**2).mean())


def test_every_kind_of_impulse_is_told():
    """What was given is in the water, has struck, met or come to rest: all of it but what waits at the disks.

    Lengths of impulses are summed here; those of a fan's rays lose a few per cent when they merge, as vectors add.
    """
    water = _water(160)
    counts = water.counts
    held = water.parcels.size_m4_s.sum() * 1000.0
    assert counts.met_N_s > 0.5 and counts.struck_N_s > 5.0 and counts.rings > 5
    told = held + counts.met_N_s + counts.struck_N_s + counts.retired_N_s
    assert told == pytest.approx(160 * GIVEN_N_S.sum(), rel=0.04)


def test_room_runs_out_and_nothing_changes():
    """A water whose room for parcels and rings had to grow is byte for byte one that had enough."""
    tight, wide = _water(0), _water(0)
    tight._jets = tight.now.parcels.with_room(1)
    tight._layers = RingBuffers(*(_with_room(column[:0], 1) for column in tight._layers))
    for water in (tight, wide):
        for _ in range(60):
            water.step(0.05, DISKS_M, DISKS_M, AXES, GIVEN_N_S)
    points = np.random.default_rng(2).uniform([-1, -1, 0.6], [1, 1, 1.5], (200, 3))
    assert tight.velocity(points).tobytes() == wide.velocity(points).tobytes()
    assert tight.counts == wide.counts
