"""How many files one control step runs through: few enough for a newcomer to read."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

from numba.core.dispatcher import Dispatcher

import wakewise as ww

ROOT = Path(ww.__file__).parent


def files_of(work: Any) -> set[str]:
    """Files whose functions `work` enters, compiled ones by what their callers name."""
    seen: set[CodeType] = set()

    def follow(code: CodeType, names: dict[str, Any]) -> None:
        if code in seen or ROOT not in Path(code.co_filename).parents:
            return
        seen.add(code)
        for name in code.co_names:
            if isinstance(names.get(name), Dispatcher):
                follow(names[name].py_func.__code__, names[name].py_func.__globals__)

    def entered(frame: Any, event: str, _: Any) -> None:
        if event == "call":
            follow(frame.f_code, frame.f_globals)

    before = sys.getprofile()
    sys.setprofile(entered)
    try:
        work()
    finally:
        sys.setprofile(before)
    return {str(Path(code.co_filename).relative_to(ROOT)) for code in seen}


def test_a_step_of_wake_aware_touches_at_most_25_files_in_6_packages() -> None:
    """Plan, tracking, allocation and wake over half a second; as flown, failsafe and PWM add two files."""
    parts = ww.Scenario.preset("quick", **{"target.kind": "brain", "target.points": 60}).parts()
    for controller, most in ((parts.controller, 25), (parts.pipeline, 27)):
        files = files_of(half_a_second(controller, parts))
        packages = {name.split("/")[0] for name in files if "/" in name}
        assert {"allocation", "control", "planning", "wake"} <= packages
        assert len(files) <= most, sorted(files)
        assert len(packages) <= 6, sorted(packages)


def half_a_second(controller: Any, parts: ww.Parts) -> Callable[[], None]:
    """Fly half a second, and give what flies another half."""
    state, goals = controller.init(), [parts.pilot.goal(0.02 * k, parts.start) for k in range(50)]
    for goal in goals[:25]:
        state, _ = controller.step(state, 0.02, parts.start, goal)

    def work() -> None:
        now = state
        for goal in goals[25:]:
            now, _ = controller.step(now, 0.02, parts.start, goal)

    return work
