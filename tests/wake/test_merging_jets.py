"""Jets that meet: what two become, and what it adds to the Gram matrix."""

import numpy as np
import pytest

from wakewise.allocation import Weights, min_wash_allocation
from wakewise.control import vehicle_layout
from wakewise.core.geometry import Pose, quat_from_rotvec
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import ImpingingJet, InfluenceModel, RoundJet, disturbance
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import advected_velocity
from wakewise.wake.influence import joined_jets, merging_pairs, with_merging_jets

VEHICLE = load_vehicle("paper")
LAYOUT = vehicle_layout(VEHICLE)
AHEAD = Region(
    points_W_m=np.array([[0.7, 0.0, 0.05], [0.7, 0.03, 0.05], [0.72, -0.03, 0.02]]),
    weights=np.full(3, 1.0 / 3.0),
    distance_m=np.zeros(3),
)
"""Points ahead of a vehicle at the origin that looks north, where its camera looks."""


def test_two_equal_jets_join_along_the_middle_with_the_sum_of_their_momenta():
    """Jets at right angles in a plane: the joined one starts where both have come as far, with sqrt(2) the momentum."""
    origins = np.array([[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    axes = -np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]) / np.sqrt(2.0)
    merged = joined_jets(origins, axes, ((0, 1),))
    assert (merged.first.tolist(), merged.second.tolist()) == ([0], [1])
    np.testing.assert_allclose(merged.directions, [[1.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(merged.momentum, np.sqrt(2.0))
    np.testing.assert_allclose(merged.share, 1.0)
    # They cross 0.3 m ahead after 0.3 sqrt(2) m each.
    np.testing.assert_allclose(merged.origins_m, [[0.3 - 0.3 * np.sqrt(2.0), 0.0, 0.0]], atol=1e-12)


def test_jets_that_pass_part_or_face_each_other_do_not_join():
    """Skew by many widths, parting, parallel, head-on: nothing joins; one half-width apart, half of it does."""
    side = np.array([[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    cross = -np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]) / np.sqrt(2.0)
    width = 0.096 * 0.6 * np.sqrt(2.0)
    near = joined_jets(side + np.array([[0, 0, width], [0, 0, 0]]), cross, ((0, 1),))
    np.testing.assert_allclose(near.share, 0.5)
    assert len(joined_jets(side + np.array([[0, 0, 6 * width], [0, 0, 0]]), cross, ((0, 1),)).share) == 0
    parallel, facing = np.array([[-1.0, 0, 0], [-1.0, 0, 0]]), np.array([[0, 1.0, 0], [0, -1.0, 0]])
    for axes in (parallel, facing):
        assert len(joined_jets(side, axes, ((0, 1),)).share) == 0


def test_pairs_are_those_that_share_spare_thrusts():
    """Horizontals among themselves and verticals among themselves, so that the search stays exact in lines."""
    pairs = merging_pairs(LAYOUT)
    assert set(pairs) == {(i, j) for group in (range(4), range(4, 8)) for i in group for j in group if i < j}


def test_the_gram_matrix_of_meeting_jets_is_the_single_jets_and_one_product_per_pair():
    """D grows by w |U|^2 sqrt(T_a T_b) momentum for the two forward jets, and by nothing if one of them is off."""
    plain = InfluenceModel.of(VEHICLE, AHEAD, RoundJet())
    view, X_WB = with_merging_jets(plain, LAYOUT), Pose(np.zeros(3))
    more = view.gram(X_WB) - plain.gram(X_WB)
    np.testing.assert_allclose(more, more.T)
    assert more.min() >= 0.0 and np.all(np.diag(more) == 0.0)
    merged = joined_jets(VEHICLE.thruster_positions_B_m, VEHICLE.thruster_axes_B, ((0, 1),))
    k = np.flatnonzero((merged.first == 0) & (merged.second == 1))[0]
    area = VEHICLE.disk_areas_m2[:1]
    speed = RoundJet().unit_velocity(AHEAD.points_W_m, merged.origins_m[k : k + 1], merged.directions[k : k + 1], area)[
        0
    ]
    D = merged.momentum[k] * merged.share[k] * float(AHEAD.weights @ np.sum(speed**2, axis=1))
    assert D > 1e-4 and 2.0 * more[0, 1] == pytest.approx(D, rel=1e-9)


def test_knowing_that_jets_meet_moves_the_push_to_the_rear():
    """To hold 0.3 N astern both forward jets are the least thrusts; their joined jet would hit what is looked at."""
    wrench = np.array([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    wrench[4] = 0.05 * wrench[0]
    weights = Weights(disturbance=150.0, effort=1e-3)
    plain = InfluenceModel.of(VEHICLE, AHEAD, RoundJet())
    X_WB = Pose(np.zeros(3))
    blind = min_wash_allocation(LAYOUT, wrench, plain.gram(X_WB), weights).thrusts_N
    found = min_wash_allocation(LAYOUT, wrench, with_merging_jets(plain, LAYOUT).gram(X_WB), weights)
    assert min(blind[0], blind[1]) > 0.05
    assert max(found.thrusts_N[0], found.thrusts_N[1]) < 1e-3 and found.method == "lines"
    np.testing.assert_allclose(found.wrench_B, wrench, atol=1e-9)


def test_what_two_jets_become_turns_to_the_stronger_and_the_two_end_there():
    """In a flow the joined jet of unequal thrusts leaves the bisector; squarely merged, the single ones do not go
    on.
    """
    origins = np.array([[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    axes = -np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]) / np.sqrt(2.0)
    merged = joined_jets(origins, axes, ((0, 1),), np.array([3.0, 1.0, 1e-9, 1e-9]))
    np.testing.assert_allclose(merged.momentum * merged.strength_N, np.sqrt(10.0))
    np.testing.assert_allclose(merged.directions[0], np.array([4.0, -2.0, 0.0]) / np.sqrt(20.0), atol=1e-12)
    np.testing.assert_allclose(merged.ways_m, [[0.3 * np.sqrt(2.0)] * 2])
    ahead = with_merging_jets(InfluenceModel.of(VEHICLE, AHEAD, RoundJet()), LAYOUT)
    slow = np.array([1e-9, 0.0, 0.0])
    pair = {}
    for thrusts in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        T = np.array([*thrusts, 0, 0, 0, 0, 0, 0])
        G = ahead.gram(Pose(np.zeros(3)), CrossFlow(current_W_m_s=slow, current_std_m_s=0.0, thrusts_N=T))
        pair[thrusts] = disturbance(G, T)
    assert pair[1.0, 1.0] > 20.0 * max(pair[1.0, 0.0], pair[0.0, 1.0]), "only both together blow ahead"


def test_a_bow_jet_is_charged_for_the_one_it_would_meet():
    """In a flow, of a pair that rests, each costs half of what the two would become; without the mechanism nothing."""
    plain = InfluenceModel.of(VEHICLE, AHEAD, RoundJet())
    flow = CrossFlow(
        current_W_m_s=np.array([0.0, 1e-9, 0.0]), current_std_m_s=0.0, thrusts_N=np.array([0, 0, -1.0, -1, 0, 0, 0, 0])
    )
    more = with_merging_jets(plain, LAYOUT).gram(Pose(np.zeros(3)), flow) - plain.gram(Pose(np.zeros(3)), flow)
    charge = np.diag(more)
    assert charge[0] == pytest.approx(charge[1], rel=1e-6) and charge[0] > 1e-3
    both = with_merging_jets(plain, LAYOUT).gram(Pose(np.zeros(3)))
    assert charge[0] == pytest.approx(both[0, 1], rel=0.02)


def test_as_sent_a_pair_that_rests_leaves_nothing_and_both_leave_what_they_become():
    """The matrix that the bound on power asks: one bow jet alone is not charged, both are as much as by `gram`."""
    flow = CrossFlow(
        current_W_m_s=np.array([0.0, 1e-9, 0.0]), current_std_m_s=0.0, thrusts_N=np.array([0, 0, -1.0, -1, 0, 0, 0, 0])
    )
    plain = InfluenceModel.of(VEHICLE, AHEAD, RoundJet())
    seen = with_merging_jets(plain, LAYOUT).matrices(Pose(np.zeros(3)), flow)
    one, both = np.array([1.0, 0, 0, 0, 0, 0, 0, 0]), np.array([1.0, 1, 0, 0, 0, 0, 0, 0])
    alone = disturbance(plain.gram(Pose(np.zeros(3)), flow), one)
    assert disturbance(seen.actual, one) == pytest.approx(alone) and disturbance(seen.gram, one) > 2.0 * alone
    assert disturbance(seen.actual, both) == pytest.approx(disturbance(seen.gram, both))


def meet_twin(origins, axes, pairs, sizes):
    """`joined_jets` as whole arrays: first, second, origins, directions, momentum, share, strength, ways."""
    n = len(origins)
    first, second = np.array([(a, b) for i, j in pairs for a in (i, i + n) for b in (j, j + n)]).T
    directions, places = np.concatenate([-axes, axes]), np.concatenate([origins, origins])
    d, e, r = directions[first], directions[second], places[second] - places[first]
    cosine = np.sum(d * e, axis=1)
    usable = (cosine > -0.5) & (cosine < 0.999)
    sine2 = np.where(usable, 1.0 - cosine**2, 1.0)
    along, across = np.sum(r * d, axis=1), np.sum(r * e, axis=1)
    x, y = (along - cosine * across) / sine2, (cosine * along - across) / sine2
    here, there = places[first] + x[:, None] * d, places[second] + y[:, None] * e
    width = np.maximum(0.096 * (x + y), 1e-9)
    share = np.exp(-np.log(2.0) * np.sum((there - here) ** 2, axis=1) / width**2)
    usable &= (x > 0.0) & (y > 0.0) & (share > 1e-3)
    strength = np.sqrt(sizes[first] * sizes[second])
    total = (sizes[first] / strength)[:, None] * d + (sizes[second] / strength)[:, None] * e
    momentum = np.linalg.norm(total, axis=1)
    onward = total / momentum[:, None]
    start = 0.5 * (here + there) - 0.5 * (x + y)[:, None] * onward
    found = (first, second, start, onward, momentum, share, strength, np.stack([x, y], axis=1))
    return [part[usable] for part in found]


def seen_twin(view, X_WB, flow):
    """`MergingJetsModel.matrices` in a flow, jet by jet: matrices to choose by and as sent."""
    origins, axes = X_WB.apply(view.positions_B_m), view.axes_B @ X_WB.R.T
    n = len(origins)
    weak = 0.25 * np.mean(np.abs(flow.thrusts_N))
    pushing = np.concatenate([flow.thrusts_N, -flow.thrusts_N])
    merged = joined_jets(origins, axes, view.pairs, np.where(pushing > weak, pushing, flow.nominal_thrusts_N))
    real = (pushing[merged.first] > weak) & (pushing[merged.second] > weak)
    ends, chosen = np.tile([np.inf, 1.0], (2 * n, 1)), []
    for k in np.argsort(-merged.share, kind="stable"):
        a, b = merged.first[k], merged.second[k]
        if real[k] and ends[a, 1] == 1.0 and ends[b, 1] == 1.0:
            ends[a], ends[b] = (
                (merged.ways_m[k, 0], 1.0 - merged.share[k]),
                (merged.ways_m[k, 1], 1.0 - merged.share[k]),
            )
            chosen.append(k)

    def one(k):
        place = (merged.origins_m[k : k + 1], merged.directions[k : k + 1], view.areas_m2[merged.first[k : k + 1] % n])
        return advected_velocity(
            view.wake, view.points_W_m, *place, (merged.momentum * merged.strength_N)[k : k + 1], flow
        )[0]

    slots = (np.concatenate([origins, origins]), np.concatenate([-axes, axes]), np.tile(view.areas_m2, 2))
    velocity = advected_velocity(view.wake, view.points_W_m, *slots, flow.nominal_thrusts_N, flow, ends)
    for k in chosen:
        a, b = merged.first[k], merged.second[k]
        joined = (
            merged.share[k] * np.sqrt(merged.momentum[k] * merged.strength_N[k]) / (pushing[a] + pushing[b]) * one(k)
        )
        velocity[a] += np.sqrt(pushing[a]) * joined
        velocity[b] += np.sqrt(pushing[b]) * joined
    charged = np.einsum("n,inx,jnx->ij", view.weights, velocity, velocity)
    sent = charged.copy()
    for k in np.flatnonzero(~real & (merged.share > 0.1)):
        a, b = merged.first[k], merged.second[k]
        half = 0.5 * merged.momentum[k] * merged.share[k] * float(view.weights @ np.sum(one(k) ** 2, axis=1))
        charged[[a, b], [a, b]] += half
        sent[[a, b], [b, a]] += half
    return charged, sent


def test_jets_that_meet_are_those_of_the_formulas():
    """The kernel against the formulas as whole arrays, for disks and axes of all sorts."""
    rng, some = np.random.default_rng(2), 0
    for _ in range(20):
        origins, axes = rng.uniform(-0.2, 0.2, (6, 3)), rng.normal(size=(6, 3)) * [1.0, 1.0, 0.1]
        axes /= np.linalg.norm(axes, axis=1)[:, None]
        pairs, sizes = tuple((i, j) for j in range(6) for i in range(j)), rng.uniform(0.1, 5.0, 12)
        found, wanted = joined_jets(origins, axes, pairs, sizes), meet_twin(origins, axes, pairs, sizes)
        some += len(found.share)
        for got, want in zip(found, wanted, strict=True):
            np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-12)
    assert some > 100


@pytest.mark.parametrize("wake", [RoundJet(), ImpingingJet(jet=RoundJet(), bed_z_m=0.6)])
def test_in_a_flow_the_matrices_are_those_of_jets_taken_one_by_one(wake):
    """For thrusts of which pairs push, rest, and both: each jet followed alone gives the same two matrices."""
    rng, joins = np.random.default_rng(6), 0
    view = with_merging_jets(InfluenceModel.of(VEHICLE, AHEAD, wake), LAYOUT)
    for _ in range(6):
        X_WB = Pose(0.1 * rng.normal(size=3), quat_from_rotvec(0.2 * rng.normal(size=3)))
        thrusts = rng.normal(size=8) * rng.integers(0, 2, 8)
        thrusts[:2] = np.abs(thrusts[:2]) + 1.0
        flow = CrossFlow(current_W_m_s=0.05 * rng.normal(size=3), current_std_m_s=0.02, thrusts_N=thrusts)
        seen, (charged, sent) = view.matrices(X_WB, flow), seen_twin(view, X_WB, flow)
        np.testing.assert_allclose(seen.gram, charged, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(seen.actual, sent, rtol=1e-9, atol=1e-15)
        joins += not np.array_equal(seen.gram, seen.actual)
    assert joins > 0
