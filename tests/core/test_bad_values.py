"""Whatever is given to the functions of `import wakewise`, the answer is an answer or one of Wakewise's own errors."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import wakewise as ww
from wakewise.core.errors import InputError, WakewiseError
from wakewise.wake import SUPERPOSITIONS, InfluenceModel, gram

ROV = ww.load_vehicle("bluerov2-heavy")
POSE, WRENCH = [-0.6, 0.0, 1.3, 0.0, 0.0, 0.6], [-8.0, 0.0, 2.0, 0.0, 0.0, 0.0]
POINTS = [[0.0, 0.0, 1.4], [0.1, 0.0, 1.4]]


class Odd:
    """Answers nothing, and cannot be made an array of."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no array")


ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**30), 10**30),
    st.floats(),
    st.text(max_size=6),
    st.binary(max_size=3),
    st.complex_numbers(),
    st.lists(st.one_of(st.floats(), st.integers(-9, 9), st.none(), st.text(max_size=2)), max_size=7),
    st.lists(st.lists(st.floats(-3, 3), max_size=4), max_size=3),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
    st.builds(Odd),
    st.just(Odd),
    st.just(np.zeros(3, dtype=bool)),
    st.just(np.ones(6) * 1j),
    st.just(np.array([object()] * 6)),
    st.just(np.array(["1"] * 6)),
    st.just(np.zeros((6, 6, 6))),
    st.just(np.array("2026-01-01", dtype="datetime64[D]")),
    st.just({1, 2}),
    st.just(range(8)),
)
ALLOCATE: dict[str, Any] = {"vehicle": ROV, "wrench_B": WRENCH, "pose": POSE, "region": POINTS, "wake": "jet"}
FREE = ("w_disturbance", "w_effort", "w_previous", "previous_N", "failed", "superposition", "priority", "budget")
WATER: dict[str, Any] = {"vehicle": ROV, "thrusts_N": np.ones(8), "pose": POSE}
FUNCTIONS: dict[str, tuple[Any, dict[str, Any], tuple[str, ...]]] = {
    "allocate": (ww.allocate, ALLOCATE, (*ALLOCATE, *FREE)),
    "disturbance": (ww.disturbance, WATER | {"region": POINTS}, (*WATER, "region", "wake", "superposition")),
    "velocity": (ww.velocity, WATER | {"points_W_m": POINTS}, (*WATER, "points_W_m", "wake")),
}


@pytest.mark.parametrize("function", FUNCTIONS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_only_our_own_errors_leave(function: str, data: st.DataObject) -> None:
    """Any one argument replaced by anything: an answer, or a WakewiseError of one line."""
    asked, arguments, names = FUNCTIONS[function]
    name = data.draw(st.sampled_from(names))
    value = data.draw(ODD)
    if name == "budget" and isinstance(value, int) and value > 10**4:  # as long as asked for
        value = 10**4
    try:
        asked(**{**arguments, name: value})
    except WakewiseError as fault:
        assert "\n" not in str(fault) and len(str(fault)) < 600, fault


@settings(max_examples=15, deadline=None)
@given(value=ODD)
def test_fields_of_a_scenario_are_checked_where_they_are_replaced(value: object) -> None:
    """Parts.replace with a field of any value: parts, or InputError."""
    parts = ww.Scenario.preset("quick").parts()
    for name in ("seed", "method", "mission.standoff_m", "tank.current.velocity_m_s", "control.superposition"):
        try:
            parts.replace(**{name: value})
        except WakewiseError as fault:
            assert "\n" not in str(fault), (name, fault)


@pytest.mark.parametrize(
    ("failed", "said"),
    [
        ([True] + [False] * 7, "must be a whole number"),
        (np.eye(8, dtype=bool)[0], "must be a whole number"),
        ([1.0], "must be a whole number"),
        ([1.5], "must be a whole number"),
        ([8], "allowed 0 to 7"),
        ([-1], "allowed 0 to 7"),
        (["bow"], "no such thruster"),
        ("1", "must be a list"),
        (3, "must be a list"),
    ],
)
def test_failed_thrusters_are_names_or_places(failed: Any, said: str) -> None:
    """A mask of True and False is neither, nor is a number with a fraction; names and NumPy's integers are."""
    with pytest.raises(InputError, match=f"failed: .*{said}"):
        ww.allocate(ROV, WRENCH, failed=failed)
    name = ROV.thrusters[0].name
    by_place, by_name = (ww.allocate(ROV, WRENCH, failed=one) for one in ([np.int64(0)], [name]))
    np.testing.assert_array_equal(by_place.thrusts_N, by_name.thrusts_N)
    assert by_name.thrusts_N[0] == 0.0 and (np.abs(by_name.thrusts_N[1:]) > 0.1).any()


@pytest.mark.parametrize("word", ["coherant", "", "Coherent", None, 1, ["coherent"]], ids=repr)
def test_how_jets_add_up_is_one_of_two_words(word: Any) -> None:
    """In every function that takes it."""
    region = ww.Scenario.preset("quick").parts().region
    place = (region.points_W_m, region.weights, np.zeros((1, 3)), np.eye(3)[:1], np.ones(1))
    for asked in (
        lambda: ww.allocate(ROV, WRENCH, POSE, POINTS, superposition=word),
        lambda: ww.disturbance(ROV, np.ones(8), POSE, POINTS, superposition=word),
        lambda: gram(ww.wake_model("jet"), *place, superposition=word),
        lambda: InfluenceModel.of(ROV, region, ww.wake_model("jet"), word),
    ):
        with pytest.raises(InputError, match=f"superposition: .*allowed: {', '.join(SUPERPOSITIONS)}"):
            asked()


@pytest.mark.parametrize("angles", [(0, 0, 90), (34, 0, 0), (0, -7, 0)])
def test_degrees_are_not_taken_for_radians(angles: tuple[float, ...]) -> None:
    """Beyond a whole turn an angle is refused, with a hint; a turn is none."""
    pose = [0.0, 0.0, 1.0, *angles]
    for asked in (
        lambda: ww.allocate(ROV, WRENCH, pose, POINTS),
        lambda: ww.disturbance(ROV, np.ones(8), pose, POINTS),
        lambda: ww.velocity(ROV, np.ones(8), pose, POINTS),
    ):
        with pytest.raises(InputError, match="are these degrees"):
            asked()
    assert ww.allocate(ROV, WRENCH, [0, 0, 1, 0, 0, 2 * np.pi], POINTS).gap < 1e-5


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf, "1", True, None])
def test_effort_has_a_price(weight: Any) -> None:
    """Without one, forty newtons cancel each other for a D of nothing; a scenario asks for more than 0, too."""
    with pytest.raises(InputError, match="w_effort: "):
        ww.allocate(ROV, WRENCH, POSE, POINTS, w_effort=weight)
    if isinstance(weight, float):
        with pytest.raises(InputError, match=r"control\.w_effort"):
            ww.Scenario.preset("quick", **{"control.w_effort": weight})


def test_where_nothing_is_made_the_share_is_nothing() -> None:
    """`scale` is 0, not 1, with and without a region; what is not made is in `given_up`, and printed."""
    for region in (None, POINTS):
        none = ww.allocate(ROV, WRENCH, POSE, region, failed=range(8))
        assert none.scale == 0.0 and none.given_up == {"X": -8.0, "Z": 2.0}
        assert "scale 0, given up X -8 N, Z 2 N" in str(none)
        assert ww.allocate(ROV, np.zeros(6), POSE, region).scale == 1.0
        assert ww.allocate(ROV, WRENCH, POSE, region).scale == 1.0
    sideways = ww.allocate(ROV, [0, 5, 0, 0, 0, 0], POSE, POINTS, failed=[0, 1, 2, 3])
    assert sideways.scale == 0.0 and sideways.given_up["Y"] == pytest.approx(5.0)


def test_thrusts_beyond_the_limits_are_told(caplog: pytest.LogCaptureFixture) -> None:
    """Named with the limits; thrusts at the limits are none."""
    for thrusts, lines in ((ROV.thrust_upper_N, 0), (ROV.thrust_lower_N, 0), (np.full(8, 100.0), 1)):
        caplog.clear()
        ww.velocity(ROV, thrusts, POSE, POINTS)
        assert len(caplog.records) == lines
    assert f"thrusts_N: {ROV.thrusters[0].name} 100 N, allowed -" in caplog.text
