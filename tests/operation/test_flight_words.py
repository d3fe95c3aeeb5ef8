"""A flight is printed in one line, which says what was measured and nothing else."""

import re
from dataclasses import dataclass

import pytest

import wakewise as ww


@dataclass(frozen=True)
class Sea:
    """The tank, without anybody who knows the truth."""

    tank: object
    name: str = "sea"

    def begin(self):
        return self.tank.begin()[0], None


def test_a_flight_is_one_line():
    """Method, seed, water, error, energy, length; what went amiss only where something did."""
    parts = ww.Scenario.preset("quick", method="dp", seed=4, **{"target.points": 60}).parts()
    said = str(ww.fly(parts, duration_s=0.4))
    assert re.fullmatch(
        r"dp, seed 4: water at the target \d+\.\d\d mm/s, \d+\.\d mm off its way, \d\.\d{3} kJ, 0 s"
        r" \(hover only: the first leg begins after 12 s\)",
        said,
    )


@pytest.mark.slow
def test_figures_of_a_flight_that_reaches_a_leg_are_not_called_those_of_a_hover():
    """A flight of two seconds whose hover takes one."""
    fields = {"target.points": 60, "mission.settle_s": 1.0}
    said = str(ww.fly(ww.Scenario.preset("quick", method="dp", **fields).parts(), duration_s=2.0))
    assert said.endswith(" kJ, 1 s")


def test_what_nobody_knows_is_not_said():
    """Without a truth provider there is no water, no truth and no energy to tell of."""
    parts = ww.Scenario.preset("quick", method="dp", **{"target.points": 60}).parts()
    assert str(ww.fly(parts.replace(world=Sea(parts.world)), duration_s=0.4)).startswith("dp, seed 1: 0 s (hover only")


@pytest.mark.usefixtures("fallbacks_fly")
def test_steps_that_were_not_the_methods_own_are_counted():
    """A controller that raises is flown by dp, and the line says how often."""

    class Broken:
        name = "broken"

        def init(self):
            return None

        def step(self, state, dt_s, estimate, goal):
            raise ZeroDivisionError

    parts = ww.Scenario.preset("quick", **{"target.points": 60}).parts()
    assert "0 s, 20 fallbacks" in str(ww.fly(parts.replace(controller=Broken()), duration_s=0.4))
