"""A controller that nobody here has read cannot end a flight or send nonsense: the failsafe flies on and says why."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import polars as pl
import pytest

import wakewise as ww
from wakewise.control import with_failsafe
from wakewise.control.pipeline import PluginStage
from wakewise.core.errors import InputError, StageError
from wakewise.operation.plugin_adapter import described

pytestmark = pytest.mark.usefixtures("fallbacks_fly")

SECONDS = 0.4


@cache
def parts():
    return ww.Scenario.preset("quick", **{"target.kind": "brain", "target.points": 60}).parts()


NEEDED = "must answer a Command of 8 thrusts after its state"


@dataclass
class Foreign:
    """Does what it is told at every step, from the third on."""

    act: object
    name: str = "theirs"

    def init(self):
        return 0

    def step(self, state, dt_s, estimate, goal):
        good = ww.Command(thrusts_N=np.full(8, 0.1), wrench_B=np.zeros(6))
        return state + 1, good if state < 2 else self.act(good)


def raises(_):
    raise ZeroDivisionError("no such thing")


def nan(good):
    return ww.Command(thrusts_N=np.full(8, np.nan), wrench_B=np.zeros(6))


def seven(good):
    return ww.Command(thrusts_N=np.zeros(7), wrench_B=np.zeros(6))


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (raises, "theirs: raised ZeroDivisionError: no such thing (test_plugin_adapter.py:"),
        (nan, "theirs: raised NotFinite: thrusts_N: holds NaN"),
        (seven, f"theirs: raised TypeError: {NEEDED}, not Command of 7 thrusts"),
        (lambda good: good.thrusts_N, f"theirs: raised TypeError: {NEEDED}, not ndarray (8,)"),
    ],
)
def test_nonsense_is_flown_by_pid_and_counted(act, words):
    """The flight is whole; each bad step has its reason in one line, and the thrusts flown are finite, one each."""
    flight = ww.fly(parts().replace(controller=Foreign(act)), duration_s=SECONDS)
    said = flight.steps["fallback"].to_list()
    assert len(said) == 20 and said[:2] == ["", ""]
    assert all(
        line.startswith(words) and line.endswith("; PID and least thrusts") and "\n" not in line for line in said[2:]
    )
    assert flight.figures["fallbacks"] == 18
    thrusts = flight.steps.select(pl.selectors.starts_with("command_")).to_numpy()
    assert thrusts.shape == (20, 8) and np.isfinite(thrusts).all()
    assert flight.steps["est_x_m"].is_finite().all()


def test_an_answer_without_a_state_says_what_is_needed():
    """A Command alone, though it is right by itself."""
    alone = Foreign(lambda good: good)
    alone.step = lambda state, dt_s, estimate, goal: ww.Command(thrusts_N=np.full(8, 0.1), wrench_B=np.zeros(6))
    flight = ww.fly(parts().replace(controller=alone), duration_s=SECONDS)
    assert flight.steps["fallback"][2].startswith(f"theirs: raised TypeError: {NEEDED}, not Command of 8 thrusts")


def test_thrusts_beyond_the_limits_are_cut_and_counted():
    """What a thruster cannot give is not sent."""
    flight = ww.fly(
        parts().replace(controller=Foreign(lambda _: ww.Command(thrusts_N=np.full(8, 1e6), wrench_B=np.zeros(6)))),
        duration_s=SECONDS,
    )
    most = parts().vehicle.thrust_upper_N
    assert np.all(flight.steps.select(pl.selectors.starts_with("command_")).to_numpy() <= most + 1e-9)
    assert "beyond their limits, cut" in flight.steps["fallback"][5]


def no_controller(task):
    """Forgets to return what it made."""


def one_without_step(task):
    broken = Foreign(nan)
    broken.step = None
    return broken


def one_without_a_name(task):
    return Foreign(nan, name="")


@pytest.mark.parametrize(
    ("maker", "words"),
    [
        (no_controller, "controller: None has no init, step, must be a controller with init, step"),
        (one_without_step, "controller: Foreign(.*) has no step, must be a controller with init, step"),
        (one_without_a_name, "controller: Foreign(.*) has no name for tables, must have a text"),
    ],
)
def test_what_a_method_from_outside_gives_must_be_a_controller(maker, words):
    """It is refused in one line that names the method, as a controller given in Python is; `dp` is not flown for it."""
    name = f"{__name__}:{maker.__name__}"
    with pytest.raises(InputError, match=f"^method '{name}': {words}") as caught:
        ww.fly(parts().replace(method=name), duration_s=0.1)
    assert "\n" not in str(caught.value)


def slow_flight(clock, patience_s=5.0):
    pipeline = with_failsafe(Foreign(lambda good: good, name="slow"), parts().vehicle, parts().control, foreign=True)
    pipeline.failsafe.clock, pipeline.failsafe.patience_s = clock, patience_s
    return pipeline


def test_two_seconds_a_step_are_counted_and_after_some_patience_not_asked_for_again():
    """A simulated world waits, so late thrusts are flown and said; then the PID flies the rest, said too."""
    now = iter(np.arange(0.0, 1000.0, 2.0))
    controller = slow_flight(lambda: float(next(now)))
    state, goal = controller.init(), ww.Goal(X_WB=parts().start.X_WB)
    said = []
    for _ in range(6):
        state, command = controller.step(state, 0.02, parts().start, goal)
        said.append(command.fallback or "")
    assert said[0] == "", "the first step may compile"
    assert said[1] == "slow: late, 2000 ms of 20 allowed"
    assert said[-1].startswith("slow: given up, 6 s late in all, last 2.00 s for 0.02 s; PID and least thrusts")


def test_an_init_that_raises_leaves_the_flight_to_the_pid(caplog):
    """Nothing of the controller is asked after that; a warning says so, once."""
    broken = Foreign(raises)
    broken.init = lambda: 1 / 0
    flight = ww.fly(parts().replace(controller=broken), duration_s=0.1)
    warned = [line.getMessage() for line in caplog.records if "init" in line.getMessage()]
    assert len(warned) == 1 and warned[0].startswith("control: theirs: init raised ZeroDivisionError: division by zero")
    assert set(flight.steps["fallback"]) == {
        line for line in flight.steps["fallback"] if line.startswith("theirs: init raised ZeroDivisionError")
    }


def test_another_part_that_raises_ends_the_flight_in_one_line():
    """A pilot has no backup: the error names it and the instant."""

    @dataclass
    class Pilot:
        name: str = "lost"

        def goal(self, time_s, estimate):
            if time_s > 0.1:
                raise RuntimeError("where am I")
            return ww.Goal(X_WB=parts().start.X_WB)

    with pytest.raises(StageError, match=r"fly: ended after 0\.1 s by RuntimeError: where am I; from outside: pilot"):
        ww.fly(parts().replace(pilot=Pilot(), method="dp"), duration_s=SECONDS)


def test_memory_that_runs_out_is_blamed_on_no_part():
    """It stays the computer's fault, to be told as such and flown again, though the pilot is from outside."""

    @dataclass
    class Pilot:
        name: str = "hungry"

        def goal(self, time_s, estimate):
            raise MemoryError("Unable to allocate 214 GiB")

    with pytest.raises(MemoryError, match="214 GiB"):
        ww.fly(parts().replace(pilot=Pilot(), method="dp"), duration_s=SECONDS)


def broken_begin():
    raise RuntimeError("no water")


@pytest.mark.parametrize(
    ("begin", "words"),
    [
        (broken_begin, "does not begin, RuntimeError: no water"),
        (lambda: None, "does not begin, TypeError: cannot unpack"),
    ],
)
def test_a_world_that_does_not_begin_is_refused_by_name(begin, words):
    """Whether it raises or gives nothing: the line says which part it is."""

    class Dry:
        name = "dry"

    world = Dry()
    world.begin = begin
    with pytest.raises(InputError, match=rf"fly: {words}.*; from outside: world dry \(.*Dry\)"):
        ww.fly(parts().replace(world=world, method="dp"), duration_s=0.1)


def nothing(*_):
    """Forgets to return what it made."""


class DryWorld:
    """A world made from parts, which does not begin."""

    name = "dry"

    def __init__(self, parts):
        self.begin = broken_begin


@pytest.mark.parametrize(
    ("field", "what", "needed"),
    [
        ("world", "world 'NAME': world", "begin"),
        ("pilot", "pilot 'NAME': pilot", "goal"),
        ("control.wake.model", "wake model 'NAME': wake", "unit_velocity"),
    ],
)
def test_a_maker_that_gives_nothing_is_refused_by_name(field, what, needed):
    """One line says whose it is and which methods are needed."""
    name = f"{__name__}:nothing"
    words = f"^{what.replace('NAME', name)}: None has no {needed}, must be a [a-z]+ with {needed}$"
    with pytest.raises(InputError, match=words):
        ww.fly(parts().requested.replace(method="dp", **{field: name}), duration_s=0.1)


def test_a_world_of_the_scenario_that_does_not_begin_is_named_once():
    """Its place says what it is; the same place again as its origin says no more."""
    name = f"{__name__}:DryWorld"
    with pytest.raises(InputError, match=rf"does not begin, RuntimeError: no water; from outside: world {name}$"):
        ww.fly(parts().requested.replace(method="dp", world=name), duration_s=0.1)


def test_a_world_that_does_not_wait_has_the_deadline_enforced():
    """It says so by `waits`; a world that says nothing waits."""

    class Sea:
        name, waits = "sea", False

        def begin(self):
            pytest.fail("nothing is flown")

    own = parts().replace(method="dp")
    assert own.replace(world=Sea()).pipeline.failsafe.enforce and not own.pipeline.failsafe.enforce


def test_our_own_are_flown_as_pipelines_and_a_stranger_as_a_foreign_stage_of_one():
    """Stages of our own stay as they are; both have one failsafe, which waits as the tank does."""
    own = parts().replace(method="dp")
    assert own.pipeline.motion is own.controller.motion
    assert not own.pipeline.failsafe.enforce and not own.pipeline.failsafe.foreign
    assert own.replace(vehicle=own.vehicle.with_ideal_thrusters()).pipeline.name == own.controller.name
    theirs = parts().replace(controller=Foreign(nan)).pipeline
    assert isinstance(theirs.motion, PluginStage) and theirs.failsafe.foreign
    assert described(Foreign(nan)) == "theirs (test_plugin_adapter.Foreign)"
