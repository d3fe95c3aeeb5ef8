"""A person at the sticks: what is seen late and roughly becomes pushes on two sticks.

The crossover model (McRuer and Jex 1967, doi 10.1109/THFE.1967.234304): whatever is steered, a person shapes the
answer so that the open loop is w_c exp(-j w tau) / (j w) about the crossover frequency w_c: a plain gain where the
stick asks for a rate, a gain with a lead where it asks for a force. w_c is what the delays in the loop leave of the
phase that the person keeps in hand. About that stand the limits: few axes are minded at a time, small offsets are let
be, what is seen carries noise in proportion to its size (remnant, Levison, Baron and Kleinman 1969, doi
10.1109/TMMS.1969.299906), the place beside the target is judged by eye and drifts, and thumbs move sticks by steps.

Four axes, always in this order: forward, right, down (N, or m/s where the stick asks for a rate), turn (rad/s). All
of it is a pure function of the state: the noise of step k is a function of the person's seed and k.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.control.operator_population import POPULATION, OperatorPopulation
from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.geometry import Pose

AXES = ("forward", "right", "down", "turn")
NEUROMUSCULAR_S = 0.1
"""Lag of the hand (McRuer and Jex 1967), part of the effective delay."""
LOOK_S = 2.0
"""An axis unseen for this long is as pressing as one that is off by what is let be; estimate."""
MOST_PRESSING = 3.0
"""An axis off by so many times what is let be is as pressing as can be, so that none is forgotten; estimate."""
MEMORY_S = 4.0
"""Time over which the size of what is seen is averaged, for its noise; estimate."""
THUMB_S = 0.25
"""Shortest nudge of a thumb; estimate, as long as an effective delay."""
FARTHEST_M = 3.0
"""A target farther off than this, or behind, is not what the camera is kept on."""
_COLUMNS = 11


@dataclass(frozen=True, kw_only=True, eq=False)
class StickDeflection:
    """What the four axes of two sticks do, shape (4,) each.

    `inertia` in kg, 0 where the stick asks for a rate; `drag` in N/(m/s); `full` is the force, or rate, of full stick
    at gain 1; `lag_s` how much later the vehicle answers.
    """

    inertia: Array
    drag: Array
    full: Array
    lag_s: Array

    def __post_init__(self) -> None:
        freeze(self, inertia=(4,), drag=(4,), full=(4,), lag_s=(4,))


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraMotion:
    """What matters of a camera's pose: place and velocity in W, shape (3,) each, heading and its rate.

    `hull_W_m_s` is the velocity of the hull behind it, whose drag a practised hand pushes against.
    """

    p_W_m: Array
    heading_rad: float
    v_W_m_s: Array
    turn_rad_s: float
    hull_W_m_s: Array

    @classmethod
    def of(cls, X_WB: Pose, nu_B: Array, X_BC: Pose) -> CameraMotion:
        """Of a body and its twist in its own frame, shape (6,)."""
        R = X_WB.R
        v_W = R @ (nu_B[:3] + np.cross(nu_B[3:], X_BC.p_m))
        axis_W = R @ X_BC.R[:, 2]
        return cls(
            p_W_m=X_WB.p_m + R @ X_BC.p_m,
            heading_rad=math.atan2(axis_W[1], axis_W[0]),
            v_W_m_s=v_W,
            turn_rad_s=float((R @ nu_B[3:])[2]),
            hull_W_m_s=R @ nu_B[:3],
        )

    @property
    def row(self) -> Array:
        """As one array, shape (11,)."""
        return np.array([*self.p_W_m, self.heading_rad, *self.v_W_m_s, self.turn_rad_s, *self.hull_W_m_s])


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatorModel:
    """One person, drawn; times in s, shares of the distance to the target where no unit is named.

    `crossover_rad_s`, shape (4,), and `rate_gain`, what a rate that is seen is answered with, N/(m/s), or an offset
    where the stick asks for a rate, 1/s; `step`, shape (4,), what is let be (forward, right, down as shares, turn in
    rad), and `drift`, shape (4,), the rms of the errors of the eye, likewise.
    """

    seed: int
    sticks: StickDeflection
    delay_s: float
    video_s: float
    crossover_rad_s: Array
    lead_s: Array
    rate_gain: Array
    remnant: float
    attended: int
    dwell_s: tuple[float, float]
    step: Array
    rate_step_per_s: float
    drift: Array
    drift_s: float
    pace: float
    trim_s: float
    gain: float
    stick_step: float

    def __post_init__(self) -> None:
        freeze(self, crossover_rad_s=(4,), lead_s=(4,), rate_gain=(4,), step=(4,), drift=(4,))


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatorModelState:
    """What a person carries on: count of steps, what was seen and desired (newest first), hands and habits.

    `seen` and `desired`, shape (n, 11), rows as `CameraMotion.row`; the rest, shape (4,): `hand` what the hands make of
    it, `trim` the steady push that was learned, `drift` the error of the eye now, `last` and `unseen_s` the offset last
    seen and how long ago, `pushed` where the sticks are and `owed` what they fell short of, both shares of full stick,
    `square` and `rate_square` what is seen, squared and averaged, `minded` the axes that are minded, for `until_s`
    more.
    """

    steps: int
    seen: Array
    desired: Array
    hand: Array
    trim: Array
    drift: Array
    last: Array
    unseen_s: Array
    pushed: Array
    owed: Array
    thumb_s: float
    square: Array
    rate_square: Array
    minded: BoolArray
    until_s: float


def sample_operator(seed: int, sticks: StickDeflection, people: OperatorPopulation = POPULATION) -> OperatorModel:
    """The person that a seed draws from these people, at these sticks."""
    rng = np.random.default_rng(seed)

    def one(low_high: tuple[float, float]) -> float:
        return float(rng.uniform(*low_high))

    delay_s, video_s = one(people.delay_s), one(people.video_s)
    margin_rad, lead_most_s = math.radians(one(people.phase_margin_deg)), one(people.lead_most_s)
    late_s = delay_s + video_s + sticks.lag_s
    image, size = one(people.image_step), one(people.size_step)
    forced = sticks.inertia > 0.0
    # A vehicle's own time constant, and the lead that a person makes of as much of it as can be made.
    coast_s = np.where(forced, sticks.inertia / np.maximum(sticks.drag, 1e-9), 0.0)
    lead_s = np.minimum(coast_s, lead_most_s)
    crossover = _crossover(margin_rad, late_s, coast_s, lead_s)
    return OperatorModel(
        seed=seed,
        sticks=sticks,
        delay_s=delay_s,
        video_s=video_s,
        crossover_rad_s=crossover,
        lead_s=lead_s,
        # So that the open loop is one at the crossover.
        rate_gain=np.where(
            forced,
            crossover
            * np.hypot(sticks.inertia * crossover, sticks.drag)
            / np.hypot(crossover, 1.0 / np.where(forced, lead_s, 1.0)),
            crossover,
        ),
        remnant=one(people.remnant),
        attended=people.attended,
        dwell_s=people.dwell_s,
        step=np.array([size, image, image, image]),
        rate_step_per_s=one(people.rate_step_per_s),
        drift=np.array(
            [
                one(people.standoff_drift),
                math.radians(one(people.azimuth_drift_deg)),
                one(people.level_drift),
                math.radians(one(people.heading_drift_deg)),
            ]
        ),
        drift_s=one(people.drift_s),
        pace=one(people.pace),
        trim_s=one(people.trim_s),
        gain=one(people.gain),
        stick_step=one(people.stick_step),
    )


def begin(person: OperatorModel) -> OperatorModelState:
    """Before the first look: nothing seen yet, hands off the sticks."""
    zero, none = np.zeros(4), np.empty((0, _COLUMNS))
    eye = person.drift * _noise(person, 0)[:4]
    return OperatorModelState(
        steps=1,
        seen=none,
        desired=none,
        hand=zero,
        trim=zero,
        drift=eye,
        last=zero,
        unseen_s=zero,
        pushed=zero,
        owed=zero,
        thumb_s=0.0,
        square=zero,
        rate_square=zero,
        minded=np.zeros(4, np.bool_),
        until_s=0.0,
    )


def steer(
    person: OperatorModel,
    state: OperatorModelState,
    dt_s: float,
    view: CameraMotion,
    goal_view: CameraMotion,
    watch_W_m: Array | None = None,
) -> tuple[OperatorModelState, Array]:
    """One step of a person at the sticks.

    `view` is the camera as it is now, which the person sees later, `goal_view` where it is desired, and `watch_W_m`,
    shape (3,), what the camera is to be kept on; None: the desired heading. Gives the next state, and what
    the sticks ask for, shape (4,): N, m/s, rad/s as `StickDeflection` says, in the vehicle's level frame (forward along
    its heading).
    """
    late, later = round((person.delay_s - NEUROMUSCULAR_S) / dt_s), round(person.video_s / dt_s)
    seen = np.concatenate([view.row[None], state.seen])[: late + later + 1]
    desired = np.concatenate([goal_view.row[None], state.desired])[: late + 1]
    noise = _noise(person, state.steps)
    keep = math.exp(-dt_s / person.drift_s)
    drift = keep * state.drift + math.sqrt(1.0 - keep * keep) * person.drift * noise[:4]
    next_state = replace(state, steps=state.steps + 1, seen=seen, desired=desired, drift=drift)
    if len(seen) <= late + later:
        # Nothing has come through yet.
        return next_state, np.zeros(4)

    offset, rate, ahead, far_m = _offsets(seen[-1], desired[-1], watch_W_m)
    scale = np.array([far_m, far_m, far_m, 1.0])
    offset = offset - scale * drift
    pressing = np.minimum(np.abs(state.last) / (scale * person.step), MOST_PRESSING) + state.unseen_s / LOOK_S
    minded, until_s = state.minded, state.until_s - dt_s
    if until_s <= 0.0:
        minded = np.zeros(4, np.bool_)
        minded[np.argsort(-pressing, kind="stable")[: person.attended]] = True
        low, high = person.dwell_s
        until_s = low + (high - low) * 0.5 * (1.0 + math.erf(noise[12] / math.sqrt(2.0)))

    forget = math.exp(-dt_s / MEMORY_S)
    square = forget * state.square + (1.0 - forget) * offset**2
    rate_square = forget * state.rate_square + (1.0 - forget) * rate**2
    # White noise of spectral density remnant pi s^2; half the attention has twice of it (Levison, Baron and Kleinman).
    loud = math.sqrt(math.pi * person.remnant * person.attended / dt_s)
    looked = _beyond(offset, scale * person.step) + loud * np.sqrt(square) * noise[4:8]
    moving = _beyond(rate, scale * person.rate_step_per_s) + loud * np.sqrt(rate_square) * noise[8:12]

    sticks = person.sticks
    forced = sticks.inertia > 0.0
    lead = np.where(forced, person.lead_s, 1.0)
    answer = person.rate_gain * np.where(forced, moving + looked / lead, looked)
    answer = np.where(minded, answer, 0.0)
    trim = state.trim + np.where(minded & forced, dt_s / person.trim_s, 0.0) * answer
    # The pace of the mission, as the person would begin it; where the stick asks for a force, its drag.
    steady = person.pace * np.where(forced, sticks.drag * ahead, ahead)
    hand = state.hand + (1.0 - math.exp(-dt_s / NEUROMUSCULAR_S)) * (answer + trim + steady - state.hand)
    full = person.gain * sticks.full
    pushed, thumb_s, finest = state.pushed, state.thumb_s - dt_s, person.stick_step
    owed = state.owed + (hand / full - pushed) * dt_s / THUMB_S
    # A thumb follows at once; what is finer than its step is made by nudges, as long and as often as it takes.
    free = (np.abs(hand / full - pushed) > finest) | (thumb_s <= 0.0)
    pushed = np.where(free, np.clip(np.round((hand / full + owed) / finest) * finest, -1.0, 1.0), pushed)
    thumb_s = THUMB_S if thumb_s <= 0.0 else thumb_s
    owed = np.clip(owed, -finest, finest)
    next_state = replace(
        next_state,
        hand=hand,
        trim=np.clip(trim, -full, full),
        last=np.where(minded, offset, state.last),
        unseen_s=np.where(minded, 0.0, state.unseen_s + dt_s),
        pushed=pushed,
        owed=owed,
        thumb_s=thumb_s,
        square=square,
        rate_square=rate_square,
        minded=minded,
        until_s=until_s,
    )
    return next_state, pushed * full


def _crossover(margin_rad: float, late_s: Array, coast_s: Array, lead_s: Array) -> Array:
    """Frequency, shape (4,), at which delays, and inertia beyond the lead, leave the phase that is kept in hand.

    Slow steering of a vehicle that coasts beyond the lead has little phase, too: of two such frequencies it is the
    upper one, and where no frequency leaves as much, that which leaves most.
    """

    def left_rad(omega: Array) -> Array:
        return np.asarray(0.5 * math.pi - omega * late_s - np.arctan(omega * coast_s) + np.arctan(omega * lead_s))

    grid = np.geomspace(1e-2, 1e2, 400)[:, None]
    low = np.where(coast_s > lead_s, grid[np.argmax(left_rad(grid), axis=0), 0], 0.0)
    high = np.where(left_rad(low) > margin_rad, 1e3, low)
    for _ in range(60):
        middle = 0.5 * (low + high)
        enough = left_rad(middle) > margin_rad
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return low


def _offsets(seen: Array, desired: Array, watch_W_m: Array | None) -> tuple[Array, Array, Array, float]:
    """Goal less view in the level frame of the view, its rate, the goal's own rate, shape (4,) each; the distance."""
    c, s = math.cos(seen[3]), math.sin(seen[3])
    level = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    heading, far_m, turn = desired[3], 1.0, desired[7]
    if watch_W_m is not None:
        away = watch_W_m - seen[:3]
        flat_m = math.hypot(away[0], away[1])
        ahead = away[0] * math.cos(desired[3]) + away[1] * math.sin(desired[3])
        if ahead > 0.0 and flat_m < FARTHEST_M:
            heading, far_m = math.atan2(away[1], away[0]), float(np.linalg.norm(away))
    offset = np.append(level @ (desired[:3] - seen[:3]), math.remainder(heading - seen[3], 2.0 * math.pi))
    rate = np.append(level @ (desired[4:7] - seen[4:7]), turn - seen[7])
    return offset, rate, np.append(level @ desired[8:11], turn), far_m


def _beyond(values: Array, step: Array) -> Array:
    """What of each value lies beyond what is let be."""
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - step, 0.0))


def _noise(person: OperatorModel, step: int) -> Array:
    """Thirteen standard normal numbers of one step, a function of the person and the step alone."""
    return np.random.Generator(np.random.Philox(key=person.seed, counter=[0, step, 0, 0])).standard_normal(13)
