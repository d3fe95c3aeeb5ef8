"""The helm's rules, as laws that hold whatever clients do and however slow their messages are."""

from __future__ import annotations

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from wakewise.ui.cockpit.control_mailbox import FORGET_S, INPUT_TIMEOUT_S, LEASE_TIMEOUT_S, ControlLease

FULL = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
CLIENTS = st.sampled_from(["a", "b", "c"])


def held_by(client: str, now_s: float = 0.0) -> ControlLease:
    """A helm that a client has just been given under the lease L."""
    helm, _ = ControlLease().ask(client, now_s, "L")
    return helm


def test_a_free_helm_is_given_to_who_asks() -> None:
    """The first who asks has it."""
    helm = held_by("a")
    assert (helm.holder, helm.lease, helm.held(0.5)) == ("a", "L", True)


def test_a_second_one_must_be_agreed_to() -> None:
    """Who asks a hand that flies waits for its consent, force or not; then the lease is a new one."""
    helm, words = held_by("a").ask("b", 0.1, "M")
    assert (helm.holder, helm.asked_by) == ("a", "b")
    assert "must agree" in words
    forced, words = held_by("a").ask("b", 0.1, "M", force=True)
    assert (forced.holder, forced.asked_by) == ("a", None)
    assert "refused" in words
    other, _ = helm.consent("c", "b", True, 0.2, "N")
    assert other.holder == "a"
    given, _ = helm.consent("a", "b", True, 0.2, "N")
    assert (given.holder, given.lease) == ("b", "N")
    kept, _ = helm.consent("a", "b", False, 0.2, "N")
    assert (kept.holder, kept.asked_by) == ("a", None)


def test_a_lapsed_helm_may_be_taken() -> None:
    """After a second without sticks it is anybody's, and its holder's own again if nobody came."""
    late = LEASE_TIMEOUT_S + 0.01
    assert not held_by("a").held(late)
    taken, _ = held_by("a").ask("b", late, "M")
    assert taken.holder == "b"
    back, took = held_by("a").moved("a", "L", 1, 0.0, FULL, late)
    assert took
    assert back.held(late)


def test_a_page_left_open_for_a_day_holds_nothing() -> None:
    """Its lease is void, so that its sticks, buttons and dials are nobody's."""
    day_s = 86400.0
    helm = held_by("a")
    assert not helm.moved("a", "L", 1, 1e3 * day_s, FULL, day_s)[1]
    assert not helm.press("a", "L", "capture", day_s)[1]
    assert not helm.may("a", "L", day_s)
    assert helm.tick(day_s).holder is None
    assert helm.tick(FORGET_S).holder == "a"


def test_replayed_and_older_sticks_are_dropped() -> None:
    """Only a higher number counts."""
    helm, took = held_by("a").moved("a", "L", 5, 0.0, FULL, 0.0)
    assert took
    for seq in (5, 4, 0):
        assert not helm.moved("a", "L", seq, 100.0, -FULL, 0.1)[1]
    assert helm.moved("a", "L", 6, 100.0, -FULL, 0.1)[1]


def test_sticks_that_were_long_on_their_way_are_zero() -> None:
    """A burst that was held up for half a second is not flown, though it has only just come."""
    helm = held_by("a")
    for k in range(10):
        helm, _ = helm.moved("a", "L", k, 40.0 * k, FULL, 0.04 * k)
    np.testing.assert_array_equal(helm.axes(0.4), FULL)
    helm, took = helm.moved("a", "L", 10, 400.0, FULL, 0.95)
    assert took
    assert not helm.axes(0.95).any()


def test_after_a_pause_sticks_count_once_they_were_let_go() -> None:
    """A page that froze, a laptop that slept, a link that was gone: what is held when it is back was not meant."""
    for pause_s in (INPUT_TIMEOUT_S + 0.01, LEASE_TIMEOUT_S + 0.5, FORGET_S - 0.1):
        helm, _ = held_by("a").moved("a", "L", 1, 0.0, FULL, 0.0)
        assert helm.axes(0.0).any()
        for k in range(5):
            now_s = pause_s + 0.04 * k
            helm, took = helm.moved("a", "L", 2 + k, 1e3 * now_s, FULL, now_s)
            assert took
            assert not helm.armed
            assert not helm.axes(now_s).any()
        now_s = pause_s + 0.2
        helm, _ = helm.moved("a", "L", 7, 1e3 * now_s, 0.0 * FULL, now_s)
        helm, _ = helm.moved("a", "L", 8, 1e3 * now_s + 40.0, FULL, now_s + 0.04)
        np.testing.assert_array_equal(helm.axes(now_s + 0.04), FULL)
    helm, _ = held_by("a").moved("a", "L", 1, 0.0, FULL, 0.0)
    helm, _ = helm.moved("a", "L", 2, 290.0, FULL, INPUT_TIMEOUT_S - 0.01)
    assert helm.axes(INPUT_TIMEOUT_S - 0.01).any(), "a hiccup within what is fresh is none"


def test_a_clock_that_stood_still_is_believed_again() -> None:
    """After a laptop slept for some seconds its sticks fly again, within the messages that clocks are compared over.

    They were let go in between, as they must be after a pause.
    """
    helm = held_by("a")
    for k in range(10):
        helm, _ = helm.moved("a", "L", k, 40.0 * k, FULL, 0.04 * k)
    flown = []
    for k in range(10, 600):
        helm, _ = helm.moved("a", "L", k, 40.0 * k, 0.0 * FULL if k == 20 else FULL, 5.0 + 0.04 * k)
        flown.append(bool(helm.axes(5.0 + 0.04 * k).any()))
    assert not flown[0]
    assert flown[-1]


def test_leaving_is_zero_at_once() -> None:
    """Given back or gone, nothing of the last stick is flown."""
    helm, _ = held_by("a").moved("a", "L", 1, 0.0, FULL, 0.0)
    assert helm.axes(0.01).any()
    gone = helm.left("a")
    assert not gone.axes(0.01).any()
    assert gone.pressed == ()
    assert helm.left("b").holder == "a"


class AnyHelm(RuleBasedStateMachine):
    """Clients ask, move, press, consent and leave in any order, with messages that are late by any time.

    The clients' clock is this one's plus an offset; the quickest message of each lease is the one that age counts from.
    """

    def __init__(self) -> None:
        super().__init__()
        self.helm, self.now_s, self.count = ControlLease(), 100.0, 0
        self.leases: dict[str, str] = {}
        self.sent: dict[int, tuple[str, float]] = {}
        self.quickest = float("inf")
        self.lease_now: str | None = None
        self.voided: set[str] = set()

    def _after(self) -> None:
        """A change of holder ends the old lease for good."""
        if self.helm.lease != self.lease_now:
            if self.lease_now is not None:
                self.voided.add(self.lease_now)
            self.lease_now, self.quickest = self.helm.lease, float("inf")
            if self.helm.holder is not None and self.helm.lease is not None:
                self.leases[self.helm.holder] = self.helm.lease

    @rule(pause_s=st.floats(0.0, 2.0))
    def wait(self, pause_s: float) -> None:
        self.now_s += pause_s
        self.helm = self.helm.tick(self.now_s)
        self._after()

    @rule(client=CLIENTS, force=st.booleans())
    def ask(self, client: str, force: bool) -> None:
        self.count += 1
        before = self.helm
        self.helm, _ = self.helm.ask(client, self.now_s, f"lease {self.count}", force)
        if before.held(self.now_s):
            assert self.helm.holder == before.holder
        self._after()

    @rule(client=CLIENTS, to=CLIENTS, yes=st.booleans())
    def consent(self, client: str, to: str, yes: bool) -> None:
        self.count += 1
        before = self.helm
        self.helm, _ = self.helm.consent(client, to, yes, self.now_s, f"lease {self.count}")
        if self.helm.holder != before.holder:
            assert (client, to, yes) == (before.holder, before.asked_by, True)
        self._after()

    @rule(client=CLIENTS)
    def leave(self, client: str) -> None:
        self.helm = self.helm.left(client)
        self._after()

    @rule(client=CLIENTS, late_s=st.floats(0.0, 1.5), seq=st.integers(0, 1000), old=st.booleans())
    def move(self, client: str, late_s: float, seq: int, old: bool) -> None:
        lease = self.leases.get(client, "none")
        before = self.helm
        sent_s = self.now_s - late_s
        axes = np.array([1.0, seq / 1000.0, 0.0, 0.0, 0.0])
        number = seq if old else before.sticks.seq + 1
        self.helm, took = self.helm.moved(client, lease, number, 1e3 * (sent_s + 7.0), axes, self.now_s)
        if took:
            assert client == before.holder
            assert lease not in self.voided
            assert number > before.sticks.seq
            self.quickest = min(self.quickest, late_s)
            self.sent = {0: (client, sent_s)}
            if before.sticks.seq >= 0 and self.now_s - before.renewed_s > INPUT_TIMEOUT_S:
                assert not self.helm.axes(self.now_s).any()
        else:
            np.testing.assert_array_equal(self.helm.axes(self.now_s), before.axes(self.now_s))

    @rule(client=CLIENTS)
    def press(self, client: str) -> None:
        before = self.helm
        self.helm, took = self.helm.press(client, self.leases.get(client, "none"), "capture", self.now_s)
        assert not took or client == before.holder

    @invariant()
    def sticks_flown_are_the_holders_and_fresh(self) -> None:
        """Never a stick older than 300 ms, past the way of the quickest message; never one of who does not hold."""
        if self.helm.axes(self.now_s).any():
            client, sent_s = self.sent[0]
            assert client == self.helm.holder
            assert self.helm.held(self.now_s)
            assert self.now_s - sent_s - self.quickest <= INPUT_TIMEOUT_S + 1e-6

    @invariant()
    def there_is_one_holder_and_one_lease(self) -> None:
        """A holder has a lease, nobody has none, and no lease comes back."""
        assert (self.helm.holder is None) == (self.helm.lease is None)
        assert self.helm.lease not in self.voided


AnyHelm.TestCase.settings = settings(max_examples=120, stateful_step_count=40, deadline=None, derandomize=True)
TestAnyHelm = AnyHelm.TestCase
