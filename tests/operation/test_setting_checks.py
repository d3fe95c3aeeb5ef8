"""What is set and cannot act is said, or refused where it contradicts itself."""

import pytest

import wakewise as ww
from wakewise.control import METHODS
from wakewise.core.errors import InputError
from wakewise.operation.scenario.setting_checks import MITIGATION_METHODS, PLANNING, ineffective_settings


def said(method, **changes):
    scenario = ww.Scenario.preset("quick", world="tank", method=method, **changes)
    return " | ".join(ineffective_settings(scenario, scenario.parts().vehicle))


@pytest.mark.parametrize("method", METHODS)
def test_defaults_leave_nothing_idle(method):
    """No method is told of a switch that nobody set."""
    assert said(method) == ""


def test_levers_that_need_another_are_named():
    """With spare off, what lies behind it is idle for a method that plans, and not for one that does not."""
    off = {"control.allocation.null_space": False}
    words = "merging_jets, advection, power_limit: nothing without"
    assert f"control.allocation.{words}" in said("wake-aware", **off)
    assert "control.allocation.advection:" in said(
        "wake-aware",
        **off,
        **{f"control.allocation.{n}": False for n in ("merging_jets", "power_limit")},
    )
    assert said("allocation-only", **off) == ""


@pytest.mark.parametrize(
    ("method", "changes", "words"),
    [
        ("dp", {"control.allocation.include_bed": True}, "control.allocation.include_bed: nothing for dp"),
        (
            "allocation-only",
            {"control.obstacles": [[2.0, 2.0, 1.0, 0.1]]},
            "control.obstacles: not kept clear of by allocation-only",
        ),
        ("dp", {"control.plan.w_track": 100.0}, "control.plan: nothing for dp"),
        ("dp", {"control.operator_seed": 3}, "control.operator_seed: nobody flies dp by hand"),
        (
            "dp",
            {"control.pulse_s": 0.1, "tank.ideal_thrusters": True},
            "control.pulse_s: the thrusters of paper hold any",
        ),
    ],
)
def test_a_setting_without_a_use_is_said(method, changes, words):
    """With its field and why; where it has a use nothing is said."""
    assert words in said(method, **changes)
    used = {"control.operator_seed": "manual", "control.allocation.include_bed": "wake-aware"}
    other = used.get(next(iter(changes)), "wake-aware")
    if "ideal" not in str(changes):
        assert said(other, **changes) == ""


@pytest.mark.parametrize(
    "mechanisms",
    [{"advection": False, "current_m_s": (0.1, 0.0, 0.0)}, {"current_m_s": (0.0, 0.0, 0.0)}],
)
def test_a_current_that_could_not_act_is_refused(mechanisms):
    """A stated current beside a mechanism that is off, or of no speed, contradicts itself."""
    with pytest.raises(InputError, match="current_m_s"):
        ww.Scenario.preset("quick", **{f"control.allocation.{name}": value for name, value in mechanisms.items()})


def test_methods_of_the_lists_are_methods():
    """A method that is renamed must be renamed here."""
    assert set(METHODS) >= PLANNING and set(METHODS) >= MITIGATION_METHODS
