"""Spare thrusts shared out anew: jets that meet, and the controllers that use them."""

import numpy as np
import pytest

from wakewise.allocation import Weights, gentle_allocation
from wakewise.control import ControlSettings, make_controller, vehicle_layout
from wakewise.control.levers import LeverSettings
from wakewise.control.spare import Respared, SpareState, joined_jets, meeting_pairs, meeting_view
from wakewise.control.thrift import Sharer
from wakewise.control.watch import Watch
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Command, Goal
from wakewise.targets import Region
from wakewise.vehicles import load_vehicle
from wakewise.wake import RoundJet, WakeView, disturbance
from wakewise.wake.carried import Flow

VEHICLE = load_vehicle("paper")
LAYOUT = vehicle_layout(VEHICLE)
AHEAD = Region(
    points_W_m=np.array([[0.7, 0.0, 0.05], [0.7, 0.03, 0.05], [0.72, -0.03, 0.02]]),
    weights=np.full(3, 1.0 / 3.0),
    distance_m=np.zeros(3),
)
"""Points ahead of a vehicle at the origin that looks north, where its camera looks."""


def watching(view, previous=1e-3):
    """What is seen through a view, in still water."""
    weights = Weights(disturbance=150.0, effort=1e-3, previous=previous)
    return Watch(view=view, levers=LeverSettings(drift=False), sharer=Sharer(layout=LAYOUT), weights=weights)


def test_two_equal_jets_join_along_the_middle_with_the_sum_of_their_momenta():
    """Jets at right angles in a plane: the joined one starts where both have come as far, with sqrt(2) the momentum."""
    origins = np.array([[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    axes = -np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]) / np.sqrt(2.0)
    met = joined_jets(origins, axes, ((0, 1),))
    assert (met.first.tolist(), met.second.tolist()) == ([0], [1])
    np.testing.assert_allclose(met.directions, [[1.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(met.momentum, np.sqrt(2.0))
    np.testing.assert_allclose(met.share, 1.0)
    # They cross 0.3 m ahead after 0.3 sqrt(2) m each.
    np.testing.assert_allclose(met.origins_m, [[0.3 - 0.3 * np.sqrt(2.0), 0.0, 0.0]], atol=1e-12)


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
    pairs = meeting_pairs(LAYOUT)
    assert set(pairs) == {(i, j) for group in (range(4), range(4, 8)) for i in group for j in group if i < j}


def test_the_gram_matrix_of_meeting_jets_is_the_single_jets_and_one_product_per_pair():
    """D grows by w |U|^2 sqrt(T_a T_b) momentum for the two forward jets, and by nothing if one of them is off."""
    plain = WakeView.of(VEHICLE, AHEAD, RoundJet())
    view, X_WB = meeting_view(plain, LAYOUT), Pose(np.zeros(3))
    more = view.gram(X_WB) - plain.gram(X_WB)
    np.testing.assert_allclose(more, more.T)
    assert more.min() >= 0.0 and np.all(np.diag(more) == 0.0)
    met = joined_jets(VEHICLE.thruster_positions_B_m, VEHICLE.thruster_axes_B, ((0, 1),))
    k = np.flatnonzero((met.first == 0) & (met.second == 1))[0]
    area = VEHICLE.disk_areas_m2[:1]
    speed = RoundJet().unit_velocity(AHEAD.points_W_m, met.origins_m[k : k + 1], met.directions[k : k + 1], area)[0]
    D = met.momentum[k] * met.share[k] * float(AHEAD.weights @ np.sum(speed**2, axis=1))
    assert D > 1e-4 and 2.0 * more[0, 1] == pytest.approx(D, rel=1e-9)


def test_knowing_that_jets_meet_moves_the_push_to_the_rear():
    """To hold 0.3 N astern both forward jets are the least thrusts; their joined jet would hit what is looked at."""
    wrench = np.array([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    wrench[4] = 0.05 * wrench[0]
    weights = Weights(disturbance=150.0, effort=1e-3)
    plain = WakeView.of(VEHICLE, AHEAD, RoundJet())
    X_WB = Pose(np.zeros(3))
    blind = gentle_allocation(LAYOUT, wrench, plain.gram(X_WB), weights).thrusts_N
    found = gentle_allocation(LAYOUT, wrench, meeting_view(plain, LAYOUT).gram(X_WB), weights)
    assert min(blind[0], blind[1]) > 0.05
    assert max(found.thrusts_N[0], found.thrusts_N[1]) < 1e-3 and found.method == "lines"
    np.testing.assert_allclose(found.wrench_B, wrench, atol=1e-9)


class Asks:
    """A controller that asks for a wrench with the least thrusts; falls back when told to."""

    name = "asks"

    def __init__(self):
        self.wrench, self.words = np.zeros(6), None

    def init(self):
        return 0

    def step(self, state, dt_s, estimate, goal):
        thrusts = LAYOUT.inverse @ self.wrench
        return state + 1, Command(thrusts_N=thrusts, wrench_B=self.wrench, disturbance=0.0, fallback=self.words)


def test_respared_thrusts_make_the_same_wrench_and_a_fallback_is_left_alone():
    """At each step, between searches ten times a second, too; a step of trouble is flown as the other wants it."""
    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    view = meeting_view(WakeView.of(VEHICLE, AHEAD, RoundJet()), LAYOUT)
    spared = Respared(
        name="x",
        inner=inner,
        watch=watching(view),
    )
    state, rng, searches = spared.init(), np.random.default_rng(1), []
    for k in range(12):
        inner.wrench = np.array([-0.3, 0.1, 0.2, 0.0, 0.05, 0.02]) + 0.02 * rng.normal(size=6)
        inner.words = "late" if k == 9 else None
        state, command = spared.step(state, 0.02, body, Goal(X_WB=body.X_WB))
        searches.append(round(state.age_s, 6) == 0.02)
        np.testing.assert_allclose(LAYOUT.B @ command.thrusts_N, inner.wrench, atol=1e-9)
        assert command.fallback == inner.words
        if k == 9:
            np.testing.assert_allclose(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
        else:
            assert not np.allclose(command.thrusts_N, LAYOUT.inverse @ inner.wrench)
    # The searches at the start and after the trouble are made at once, the others between two plans.
    assert [k for k, found in enumerate(searches) if found] == [2, 7]


def test_shares_leave_a_poor_minimum_within_two_seconds():
    """From the mirror image of the best shares, which change is priced to hold, they are at the best after 2 s."""
    inner, body = Asks(), BodyState(X_WB=Pose(np.zeros(3)))
    inner.wrench = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0])
    below = Region(
        points_W_m=np.array([[0.085, 0.14, 0.6], [-0.085, -0.14, 0.6]]), weights=np.ones(2), distance_m=np.zeros(2)
    )
    view = WakeView.of(VEHICLE, below, RoundJet())
    spared = Respared(name="x", inner=inner, watch=watching(view, previous=1e5))
    best = gentle_allocation(LAYOUT, inner.wrench, view.gram(body.X_WB), Weights(disturbance=150.0, effort=1e-3))
    poor = LAYOUT.inverse @ inner.wrench
    state = SpareState(inner=0, thrusts_N=poor, free_age_s=0.0)
    shares = []
    for _ in range(110):
        state, command = spared.step(state, 0.02, body, Goal(X_WB=body.X_WB))
        shares.append(float(np.abs(command.thrusts_N - best.thrusts_N).max()))
    assert np.abs(poor - best.thrusts_N).max() > 0.2
    assert shares[40] > 0.1 and shares[-1] < 0.05


def test_what_two_jets_become_turns_to_the_stronger_and_the_two_end_there():
    """In a flow the joined jet of unequal thrusts leaves the bisector; squarely met, the single ones do not go on."""
    origins = np.array([[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]])
    axes = -np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]) / np.sqrt(2.0)
    met = joined_jets(origins, axes, ((0, 1),), np.array([3.0, 1.0, 1e-9, 1e-9]))
    np.testing.assert_allclose(met.momentum * met.strength_N, np.sqrt(10.0))
    np.testing.assert_allclose(met.directions[0], np.array([4.0, -2.0, 0.0]) / np.sqrt(20.0), atol=1e-12)
    np.testing.assert_allclose(met.ways_m, [[0.3 * np.sqrt(2.0)] * 2])
    ahead = meeting_view(WakeView.of(VEHICLE, AHEAD, RoundJet()), LAYOUT)
    slow = np.array([1e-9, 0.0, 0.0])
    pair = {}
    for thrusts in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        T = np.array([*thrusts, 0, 0, 0, 0, 0, 0])
        G = ahead.gram(Pose(np.zeros(3)), Flow(current_W_m_s=slow, unsure_m_s=0.0, thrusts_N=T))
        pair[thrusts] = disturbance(G, T)
    assert pair[1.0, 1.0] > 20.0 * max(pair[1.0, 0.0], pair[0.0, 1.0]), "only both together blow ahead"


def test_a_bow_jet_is_charged_for_the_one_it_would_meet():
    """In a flow, of a pair that rests, each costs half of what the two would become; without the lever nothing."""
    plain = WakeView.of(VEHICLE, AHEAD, RoundJet())
    flow = Flow(
        current_W_m_s=np.array([0.0, 1e-9, 0.0]), unsure_m_s=0.0, thrusts_N=np.array([0, 0, -1.0, -1, 0, 0, 0, 0])
    )
    more = meeting_view(plain, LAYOUT).gram(Pose(np.zeros(3)), flow) - plain.gram(Pose(np.zeros(3)), flow)
    charge = np.diag(more)
    assert charge[0] == pytest.approx(charge[1], rel=1e-6) and charge[0] > 1e-3
    both = meeting_view(plain, LAYOUT).gram(Pose(np.zeros(3)))
    assert charge[0] == pytest.approx(both[0, 1], rel=0.02)


def test_as_sent_a_pair_that_rests_leaves_nothing_and_both_leave_what_they_become():
    """The matrix that the bound on power asks: one bow jet alone is not charged, both are as much as by `gram`."""
    flow = Flow(
        current_W_m_s=np.array([0.0, 1e-9, 0.0]), unsure_m_s=0.0, thrusts_N=np.array([0, 0, -1.0, -1, 0, 0, 0, 0])
    )
    plain = WakeView.of(VEHICLE, AHEAD, RoundJet())
    seen = meeting_view(plain, LAYOUT).seen(Pose(np.zeros(3)), flow)
    one, both = np.array([1.0, 0, 0, 0, 0, 0, 0, 0]), np.array([1.0, 1, 0, 0, 0, 0, 0, 0])
    alone = disturbance(plain.gram(Pose(np.zeros(3)), flow), one)
    assert disturbance(seen.sent, one) == pytest.approx(alone) and disturbance(seen.gram, one) > 2.0 * alone
    assert disturbance(seen.sent, both) == pytest.approx(disturbance(seen.gram, both))


@pytest.mark.parametrize("method", ["instant", "wake-aware"])
def test_the_noise_of_a_wrench_does_not_blow_ahead(method):
    """Astern push with noise of 0.1 N, a slow current ahead: the bow pair blows ahead with less than 3 mN in the mean.

    With the least changes between searches it was a tenth of a newton, and the tank's water remembers that.
    """
    controller = make_controller(
        method, VEHICLE, AHEAD, RoundJet(), ControlSettings(levers=LeverSettings(thrift=False))
    )
    rng, state, ahead = np.random.default_rng(3), controller.init(), []
    for _ in range(100):
        load = np.array([1.2, 0.0, 0.3, 0.0, 0.02, 0.0]) + 0.1 * rng.normal(size=6) * [1, 1, 0, 0, 0, 0.15]
        here = BodyState(X_WB=Pose(np.zeros(3)), load_B=load, current_W_m_s=np.array([0.01, 0.0, 0.0]))
        state, command = controller.step(state, 0.02, here, Goal(X_WB=here.X_WB))
        ahead.append(np.maximum(command.thrusts_N[:2], 0.0))
    assert np.mean(ahead[20:]) < 0.003


@pytest.mark.parametrize("method", ["instant", "wake-aware"])
def test_levers_reach_the_controllers(method):
    """With the levers on, a hover that pushes astern does so from the rear; the name stays."""
    settings = ControlSettings(levers=LeverSettings(drift_m_s=(0.03, 0.0, 0.0)))
    off = ControlSettings(levers=LeverSettings(spare=False, meet=False, drift=False))
    X_WB = Pose(np.zeros(3))
    estimate = BodyState(X_WB=X_WB, load_B=np.array([0.4, 0.0, 0.0, 0.0, 0.02, 0.0]))
    front = {}
    for name, chosen in (("off", off), ("on", settings)):
        controller = make_controller(method, VEHICLE, AHEAD, RoundJet(), chosen)
        state = controller.init()
        for _ in range(60):
            state, command = controller.step(state, 0.02, estimate, Goal(X_WB=X_WB))
        assert command.fallback is None and controller.name == method
        front[name] = float(command.thrusts_N[:2].max())
    assert front["off"] > 0.05 and front["on"] < 0.6 * front["off"]
