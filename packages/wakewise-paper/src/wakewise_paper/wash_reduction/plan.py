"""Which flights the bench makes: methods, wrong currents and mechanisms, in scenarios and worlds, seed by seed.

Mechanisms of `wake-aware` that the bench switches, one by one.

Each is held against the method without it, all others on (left out), and against the method without any (alone).
"""

from __future__ import annotations

from typing import Any

from wakewise.control import MAKERS
from wakewise.core.errors import InputError
from wakewise.operation.worlds.library import load_world
from wakewise_paper.flight_batches import Key
from wakewise_paper.wash_reduction.flight import TRIM, WashTrial
from wakewise_paper.wash_reduction.scenario_files import WORLD
from wakewise_paper.wash_reduction.summary_table import WRONG

Settings = dict[str, Any]

MECHANISMS: dict[str, Settings] = {
    "advection": {"allocation.advection": False},
    "merging-jets": {"allocation.merging_jets": False},
    "wall-jets": {"wake.floor": False},
    "direction-uncertainty": {"allocation.direction_uncertainty": False},
    "attitude": {"allocation.optimize_attitude": False},
    "power-limit": {"allocation.power_limit": False},
}
"""Fields of `ControlSettings` that take a mechanism away, by its name. Sharing out (`allocation.null_space`) is no
mechanism of its own:
the others need it."""

NONE = "wake-aware, no mechanisms"
LEVER_SEEDS = 3
"""Mechanisms fly the first seeds only, which have all trims and all sides once."""


def selected_mechanisms(wished: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of the mechanisms to switch; none if not given, `all` for all.

    Raises
    ------
    InputError
        If one is not known.
    """
    names = () if wished is None or wished == ("none",) else wished
    for name in names:
        if name not in (*MECHANISMS, "all"):
            raise InputError(f"mechanisms: '{name}' is not known, allowed: none, all, {', '.join(MECHANISMS)}")
    return tuple(MECHANISMS) if "all" in names else tuple(name for name in MECHANISMS if name in names)


def without(*names: str) -> Settings:
    """Fields that take these mechanisms away."""
    merged: Settings = {}
    for name in names:
        merged |= MECHANISMS[name]
    return merged


def mechanism_settings(names: tuple[str, ...]) -> dict[str, Settings]:
    """Settings of the flights that judge some mechanisms, by what the flight is called."""
    if not names:
        return {}
    table = {NONE: without(*MECHANISMS)}
    for name in names:
        table[without_name(name)] = without(name)
        table[only_name(name)] = without(*(other for other in MECHANISMS if other != name))
    return table


def without_name(name: str) -> str:
    """What the flight without a mechanism is called."""
    return f"wake-aware without {name}"


def only_name(name: str) -> str:
    """What the flight with a mechanism alone is called."""
    return f"wake-aware, {name} alone"


METHODS = (
    "dp",
    "manual",
    "no-forward-jets",
    "ardusub",
    "pseudo-inverse",
    "mpc",
    "mpc-smooth",
    "allocation-only",
    "wake-aware",
    "wake-aware+trim",
    "dp+trim",
    "no-forward-jets+trim",
)
"""The first is what the others are held against."""


def flown_methods(wished: tuple[str, ...] | None) -> tuple[tuple[str, ...], dict[str, str]]:
    """Methods to fly, in the bench's order, and why others are not.

    Raises
    ------
    InputError
        If a name is none of the bench's.
    """
    for name in wished or ():
        if name not in METHODS:
            raise InputError(f"methods: '{name}' is not known, allowed: {', '.join(METHODS)}")
    reasons: dict[str, str] = {}
    for name in METHODS:
        if wished is not None and name not in wished:
            reasons[name] = "this method was left out"
        elif name.removesuffix(TRIM) not in MAKERS:
            reasons[name] = "there is no such method yet"
    return tuple(name for name in METHODS if name not in reasons), reasons


def planned_trials(
    scenarios: tuple[str, ...], methods: tuple[str, ...], mechanisms: tuple[str, ...], seeds: int
) -> dict[Key, WashTrial]:
    """Flights to make, seed by seed, so that a run that is stopped has whole seeds; dearest mechanisms last."""
    trials: dict[Key, WashTrial] = {}
    for seed in range(1, seeds + 1):
        for scenario in scenarios:
            for method in methods:
                trials[scenario, method, seed] = WashTrial(scenario=scenario, method=method, seed=seed)
            if "wake-aware" in methods and runs(scenario):
                trials[scenario, WRONG, seed] = WashTrial(
                    scenario=scenario, method="wake-aware", seed=seed, wrong_current=True
                )
    table = mechanism_settings(mechanisms) if "wake-aware" in methods else {}
    for seed in range(1, min(seeds, LEVER_SEEDS) + 1):
        for scenario in scenarios:
            for name, settings in table.items():
                trials[scenario, name, seed] = mechanism_trial(scenario, settings, seed)
    return trials


def mechanism_trial(scenario: str, settings: Settings, seed: int) -> WashTrial:
    """Flight of `wake-aware` with some fields changed."""
    return WashTrial(scenario=scenario, method="wake-aware", seed=seed, control=tuple(sorted(settings.items())))


def runs(scenario: str) -> bool:
    """Whether there is a current that can be believed wrong."""
    if not scenario.startswith(WORLD):
        return True
    world = load_world(scenario.removeprefix(WORLD))
    field = "tank.current.velocity_m_s"
    return field in world.randomize or any(world.values.get(field, ()))


def flight_s(trial: WashTrial) -> float:
    """About how much CPU time a flight takes, in seconds: measured on two cores, for saying how long a run is."""
    if trial.duration_s is not None:
        return 0.2 * trial.duration_s
    name = trial.scenario.split("/")[0]
    base = {"station": 34.0, "nadir": 5.0, "brake": 6.0}.get(name, 8.0)
    return base + (3.0 if trial.method.endswith(TRIM) else 0.0)
