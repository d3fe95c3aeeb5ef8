"""Parts and figures say what they are: to a type checker, to `help`, and to whoever gives one in their place."""

import inspect
import pydoc
from typing import get_type_hints

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.operation import PARTS, Parts, flying
from wakewise.operation.flying import FlightFigures


def test_help_names_each_part_and_its_type():
    """The class's own text lists every part with its type; so does the line of the part itself."""
    text = pydoc.plain(pydoc.render_doc(Parts))
    told = inspect.getdoc(Parts).split("Attributes\n")[1].split("Examples")[0]
    for name in PARTS:
        kind = vars(Parts)[name].func.__annotations__["return"].split("[")[0]
        assert f"\n{name} : {kind}\n" in told, name
        assert f"{name} = <part, {kind}" in text, name


def test_the_figures_of_a_flight_are_those_that_their_type_names():
    """No key more, none less, and each of its type."""
    figures = ww.fly(ww.Scenario.preset("quick", method="dp"), duration_s=0.1).figures
    hints = get_type_hints(FlightFigures)
    assert set(figures) == set(hints)
    for name, value in figures.items():
        assert isinstance(value, hints[name]), name


class Deaf:
    """Has a name, and can do nothing."""

    name = "deaf"

    def __repr__(self):
        return "deaf"


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("given", [None, 3, "brain", [1.0, 2.0], {"x": 1}, Deaf(), Deaf, np.zeros(3)], ids=repr)
def test_what_cannot_be_a_part_is_refused_at_once(name, given):
    """Where it is given, in one line that names the part, not in the middle of a flight."""
    parts = ww.Scenario.preset("quick").parts()
    with pytest.raises(InputError) as said:
        parts.replace(**{name: given})
    assert str(said.value).startswith(f"{name}: ") and "\n" not in str(said.value)


class Nameless:
    """Has the methods of a controller and of a world, and no name."""

    def init(self):
        return 0

    def step(self, state, dt_s, estimate, goal):
        return state, ww.Command(thrusts_N=np.zeros(8), wrench_B=np.zeros(6))

    def begin(self):
        pytest.fail("nothing is flown")


@pytest.mark.parametrize("part", ["controller", "world"])
@pytest.mark.parametrize("name", [None, "", 3])
def test_a_part_that_tables_name_has_a_name(part, name):
    """Said where it is given: after the flight its figures would be lost."""
    given = Nameless()
    if name is not None:
        given.name = name
    with pytest.raises(InputError, match=f"{part}: .* has no name"):
        ww.Scenario.preset("quick").parts().replace(**{part: given})


@pytest.mark.parametrize("seconds", [0, -1, 1e-9, 0.001, float("nan"), float("inf"), "1", True, [1.0]], ids=repr)
def test_a_duration_is_at_least_one_step(seconds):
    """Less, or no number, is refused before anything is compiled."""
    with pytest.raises(InputError, match="duration_s"):
        ww.fly(ww.Scenario.preset("quick", method="dp"), duration_s=seconds)


@pytest.mark.parametrize("flight", [None, "quick", 3, {}, ww.Scenario])
def test_a_flight_is_of_parts_or_of_a_scenario(flight, tmp_path):
    """Whatever else is given to fly, trial and compare is refused."""
    for asked in (ww.fly, lambda it: ww.trial(it, tmp_path / "x"), lambda it: ww.compare({"a": it, "b": it}, tmp_path)):
        with pytest.raises(InputError, match="must be Parts or a Scenario"):
            asked(flight)
    assert list(tmp_path.iterdir()) == []


def test_compiling_is_told_of_once_where_nobody_shows_progress(monkeypatch, capsys):
    """One line on standard error, with how long; none where kernels are there, none where progress is shown."""
    work = [100.0]

    def warmed(jobs, progress):
        for done in range(3):
            if work[0]:
                progress(done, work[0], "compiling")

    monkeypatch.setattr(flying, "compile_kernels", warmed)
    scenario = ww.Scenario.preset("quick", method="dp")
    ww.fly(scenario, duration_s=0.1)
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and "compiling kernels, some 1 min" in said.err and said.out == ""
    seen = []
    ww.fly(scenario, duration_s=0.1, progress=lambda *now: seen.append(now))
    assert capsys.readouterr().err == "" and (0, 100.0, "compiling") in seen
    work[0] = 0.0
    ww.fly(scenario, duration_s=0.1)
    assert capsys.readouterr().err == ""
