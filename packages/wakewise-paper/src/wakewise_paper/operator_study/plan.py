"""Which flights the bench makes, and how long they take."""

from __future__ import annotations

from wakewise.control.intent import PAPER_W_TRACK
from wakewise.core.errors import InputError
from wakewise.operation.teleop.operator_state import RANGES
from wakewise.operation.worlds.library import world_names
from wakewise_paper.flight_batches import Key
from wakewise_paper.operator_study.flight import PILOTS, OperatorTrial
from wakewise_paper.operator_study.worlds import CONTROL, TROUBLE

W_TRACKS = (1.0, 2.0, 5.0, 10.0, 20.0)
DIRECT, OURS, UNAWARE, RULE = "dp", "wake-aware", "unaware", "bow-rule"
PLANS = (OURS, UNAWARE)
"""Methods that have a w_track; the other two are flown once for all."""
DEFAULT_WORLDS = (*TROUBLE, CONTROL)
SEEDS, GRID_SEEDS = 3, 1
"""At the paper's w_track, and at the others where only the script flies: unless more are asked for."""


def selected_worlds(wished: tuple[str, ...] | None) -> tuple[str, ...]:
    """Worlds to fly in.

    Raises
    ------
    InputError
        If one is not known.
    """
    for name in wished or ():
        if name not in world_names():
            raise InputError(f"worlds: '{name}' is not known, allowed: {', '.join(world_names())}")
    return DEFAULT_WORLDS if wished is None else tuple(dict.fromkeys(wished))


def selected_w_tracks(wished: tuple[float, ...] | None) -> tuple[float, ...]:
    """Weights to fly, in order.

    Raises
    ------
    InputError
        If one is beyond what the desk's dial has.
    """
    least, most = RANGES["w_track"]
    for value in wished or ():
        if not least <= value <= most:
            raise InputError(f"w_tracks: {value:g}, must be from {least:g} to {most:g}")
    return W_TRACKS if wished is None else tuple(sorted(set(wished)))


def planned_trials(
    worlds: tuple[str, ...], w_tracks: tuple[float, ...], seeds: int, grid_seeds: int
) -> dict[Key, OperatorTrial]:
    """Flights to make, seed by seed, what the claim needs first; direct flights are shared by all w_tracks."""
    trials: dict[Key, OperatorTrial] = {}

    def add(world: str, pilot: str, method: str, seed: int, w_track: float = PAPER_W_TRACK) -> None:
        trial = OperatorTrial(world=world, pilot=pilot, method=method, seed=seed, w_track=w_track)
        trials[key_of(trial)] = trial

    for seed in range(1, seeds + 1):
        for world in worlds:
            for pilot in PILOTS:
                add(world, pilot, DIRECT, seed)
                if PAPER_W_TRACK in w_tracks:
                    add(world, pilot, OURS, seed)
        for world in worlds:
            for pilot in PILOTS:
                add(world, pilot, RULE, seed)
                if PAPER_W_TRACK in w_tracks:
                    add(world, pilot, UNAWARE, seed)
        for w_track in (w for w in w_tracks if w != PAPER_W_TRACK and seed <= grid_seeds):
            for world in worlds:
                for method in PLANS:
                    add(world, PILOTS[0], method, seed, w_track)
    return trials


def key_of(trial: OperatorTrial) -> Key:
    """How a flight is called: world and pilot, method with its w_track, seed."""
    tag = f" {trial.w_track:g}" if trial.method in PLANS else ""
    return f"{trial.world}, {trial.pilot}", f"{trial.method}{tag}", trial.seed


def flight_s(trial: OperatorTrial) -> float:
    """About how much CPU time a flight takes, in seconds, for saying how long a run is."""
    return 8.0 if trial.method in PLANS else 6.0
