"""What the gentle bench can fly besides the plain methods: levers of control, and changes of vehicle and mission.

Levers of control are held against `wake-aware` without any and, left out one by one, against all of them together.
Those of `GENTLE` make up the bench's `wake-aware`. They were chosen by what moves the target's water in flights of
seeds from 101 on (docs/decisions/0014), so seeds 1 to 100 are free of that choice.

Changes of vehicle and mission would serve any method, so each is flown by `dp`, too, and counts for neither.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from wakewise.studies.gentle.flight import Trial, World

Settings = dict[str, Any]

CONE: Settings = {"wake.model": "paper-calibrated", "wake.edge_width_deg": 3.0}
"""Belief in the paper's cone, much wider than a jet: it stands for where a jet's water may go later."""

PARTS: dict[str, Settings] = {
    "drift": {"levers.drift": True, "levers.spare": True},
    "jets that meet": {"levers.spare": True, "levers.meet": True},
    "floor": {"wake.floor": True, "levers.spare": True},
    "bed points": {"wake.floor": True, "levers.bed": True, "levers.spare": True},
    "wide cone": CONE,
    "attitude freedom": {"plan.attitude_tolerance_rad": 0.17},
    "incoherent sum": {"superposition": "incoherent"},
}
"""Settings of control of each lever; a flight that names none has the paper's cost (`flight.OFF`)."""

GENTLE: tuple[str, ...] = ("drift", "jets that meet", "floor")
"""Levers that are on in the bench's `wake-aware`."""

OTHERS: dict[str, tuple[str, Settings]] = {
    "no planning (instant)": ("instant", {}),
    "linear wake model": ("linear", {}),
    "floor in the plan": (
        "wake-aware",
        {"wake.model": "jet-fitted", "wake.floor": True, "levers.bed": True},
    ),
}
"""Other methods and ways that are held against the plain planner."""

BALLAST_FLOAT_N, BALLAST_SHIFT_MM = 1.2, 6.0
"""A float that outdoes the unknown trim of 1 N, and a centre of gravity that balances the vehicle at a pitch of
atan(6 / 10) = 31 deg, half way between the mission's orbits of 20 and 40 deg."""
MISSIONS: dict[str, Settings] = {
    "standoff 0.65 m": {"standoff_m": 0.65},
    "floats": {"float_N": BALLAST_FLOAT_N},
    "centre of gravity forward": {"shift_mm": BALLAST_SHIFT_MM},
    "standoff and centre of gravity": {"standoff_m": 0.65, "shift_mm": BALLAST_SHIFT_MM},
    "arc with the current": {"with_current": True},
}
"""Fields of `Trial` of each change of vehicle or mission."""

IN_PAPER = ("attitude freedom", "incoherent sum", "jets that meet")
"""Levers that the paper's world can answer: it has neither bed nor memory nor current that carries wakes."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One line of the lever table.

    Parameters
    ----------
    name : str
    group : "alone", "left out", "way" or "mission"
    method : str
    base : str
        Name of the line or method that it is held against: `PLAIN`, a method of the bench, or another entry.
    control, changes : dict
        Fields of `ControlSettings`, and of `Trial`.
    """

    name: str
    group: str
    method: str
    base: str
    control: Settings = field(default_factory=dict)
    changes: Settings = field(default_factory=dict)

    def trial(self, world: World, seed: int) -> Trial:
        """The flight of one seed."""
        control = self.control
        if world == "paper":
            # There the planner believes in the world's own model; no other wake makes sense.
            control = {key: value for key, value in control.items() if not key.startswith("wake.")}
        return Trial(world=world, method=self.method, seed=seed, control=tuple(sorted(control.items())), **self.changes)


PLAIN = "wake-aware, no levers"
"""The planner with the paper's cost and the default wake model: what levers are added to."""


def together(names: tuple[str, ...]) -> Settings:
    """Settings of several levers at once."""
    merged: Settings = {}
    for name in names:
        merged |= PARTS[name]
    return merged


def method_trial(world: World, method: str, seed: int) -> Trial:
    """Flight of a method of the bench; `wake-aware` has the levers of `GENTLE` where there is water that they know.

    `pseudo-inverse` makes the wrenches of `wake-aware`, so it has them, too.
    """
    gentle = world == "parcels" and method in ("wake-aware", "pseudo-inverse")
    control = together(GENTLE) if gentle else {}
    return Trial(world=world, method=method, seed=seed, control=tuple(sorted(control.items())))


def entries(world: World) -> dict[str, Entry]:
    """All lines of the lever table of a world, by name."""
    found = [Entry(name=PLAIN, group="way", method="wake-aware", base="dp")]
    names = list(PARTS) if world == "parcels" else list(IN_PAPER)
    found += [Entry(name=n, group="alone", method="wake-aware", base=PLAIN, control=PARTS[n]) for n in names]
    found += [Entry(name=n, group="way", method=m, base=PLAIN, control=c) for n, (m, c) in OTHERS.items()]
    if world == "parcels":
        for name in GENTLE:
            rest = tuple(other for other in GENTLE if other != name)
            found.append(
                Entry(
                    name=f"without {name}",
                    group="left out",
                    method="wake-aware",
                    base="wake-aware",
                    control=together(rest),
                )
            )
        for name, changes in MISSIONS.items():
            found.append(
                Entry(
                    name=name,
                    group="mission",
                    method="wake-aware",
                    base="wake-aware",
                    control=together(GENTLE),
                    changes=changes,
                )
            )
            found.append(Entry(name=f"{name} (dp)", group="mission", method="dp", base="dp", changes=changes))
    else:
        found = [entry for entry in found if entry.name != "floor in the plan"]
    return {entry.name: entry for entry in found}
