"""Keeps the promise of the dial: a plan that would stray too far from what is asked is made firmer, plan by plan.

Weights alone promise nothing: what a plan gains by straying depends on how heavy the vehicle is and how near. Above a
target, 5 N heavy, a plan at the paper's w_track = 5 left four fifths of the way undone and won a tenth of the wash.
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.control.intent import PAPER_W_TRACK
from wakewise.core.arrays import Array

PROMISED = 0.12
"""Share of the way asked for that a plan may leave undone at the paper's w_track: of the 15 % that it promises, what is
left beside the 8 % that estimator and tracker miss of any velocity, whatever the method (in squares)."""
LEAST_M_S = 0.02
"""Slower than this on average counts as this: a plan that holds still may move by millimetres."""
FIRMEST = 100.0
"""Most that the weights of tracking are multiplied with; the plan then follows as closely as `unaware`."""
SOON_S = 0.5
"""What of a plan is looked at; much of it is flown."""
SHARPNESS, SLACKER, FIRMER = 0.7, 0.8, 3.0
"""How much firmer by how far it strays, and the least and largest change from a plan to the next: a tenth of a second,
so that a hundredfold is there within half a second, and gone in two."""


def allowed_stray(w_track: float) -> float:
    """Share of the way asked for that may be left undone at a w_track of the paper's scale: less the more it asks."""
    return PROMISED * math.sqrt(PAPER_W_TRACK / w_track)


def stray_of(states: Array, reference: Array, stage_s: float) -> float:
    """Share of the reference's way that a plan leaves undone or adds over its first `SOON_S`.

    Not over the whole horizon: a plan that is made anew ten times a second may put off for good what it plans to make
    up for at its end.

    Parameters
    ----------
    states, reference : ndarray, shape (N + 1, 13)
    stage_s : float
    """
    end = min(max(round(SOON_S / stage_s), 1), len(states) - 1)
    asked = reference[end, :3] - reference[0, :3]
    off = states[end, :3] - states[0, :3] - asked
    return float(np.linalg.norm(off)) / max(float(np.linalg.norm(asked)), LEAST_M_S * end * stage_s)


def firmer(firmness: float, stray: float, allowed: float | None) -> float:
    """What the next plan's weights of tracking are multiplied with, 1 to `FIRMEST`; 1 where nothing is promised."""
    if allowed is None:
        return 1.0
    change = min(max((stray / allowed) ** SHARPNESS, SLACKER), FIRMER)
    return min(max(firmness * change, 1.0), FIRMEST)
