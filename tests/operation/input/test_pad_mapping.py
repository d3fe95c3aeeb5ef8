"""Mappings of gamepads: from what a pad says to axes and presses, and files that are wrong."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.pad_mapping import BUTTONS, STICKS, PadMapping, PadState, load_mapping, mapping_of


def state(**moved: float) -> PadState:
    values = dict.fromkeys((*STICKS, *BUTTONS, "axis0", "axis1", "button0"), 0.0)
    return PadState(name="Some Pad", values=values | moved)


def test_dead_zones_are_taken_out_and_the_rest_is_stretched() -> None:
    """Inside the dead zone an axis is centred, at its edge it begins from nothing, and full stays full."""
    mapping = mapping_of({"dead_zone": 0.2, "axes": {"right": {"of": "leftx", "dead_zone": 0.5}}})
    for said, forward, right in ((0.19, 0.0, 0.0), (0.6, -0.5, 0.2), (1.0, -1.0, 1.0)):
        sticks = mapping.sticks(state(lefty=said, leftx=said))
        assert sticks[:2].tolist() == pytest.approx([forward, right])


def test_two_triggers_make_one_axis() -> None:
    """One pushes down, the other up; both at once cancel, and what they add up to is clipped."""
    mapping = mapping_of({"axes": {"down": ["triggerright", "-triggerleft", "dpdown"]}})
    assert mapping.sticks(state(triggerright=1.0))[2] == 1.0
    assert mapping.sticks(state(triggerleft=1.0))[2] == -1.0
    assert mapping.sticks(state(triggerright=1.0, triggerleft=1.0))[2] == 0.0
    assert mapping.sticks(state(triggerright=1.0, dpdown=1.0))[2] == 1.0


def test_what_a_pad_says_that_is_no_number_is_centred() -> None:
    """NaN and more than full do no harm."""
    assert np.all(PadMapping().sticks(state(lefty=float("nan"), leftx=1e9)) == [0.0, 1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ([], "must be a mapping"),
        ({"axis": {}}, "'axis' is unknown, allowed are pad, dead_zone, axes, buttons"),
        ({"axes": {"sideways": "leftx"}}, "axes: 'sideways' is unknown, allowed are forward, right"),
        ({"axes": {"forward": "lefty2"}}, "axes.forward: 'lefty2' is no part of a gamepad"),
        ({"axes": {"forward": {"sign": 1}}}, "'sign' is unknown"),
        ({"axes": {"forward": {"of": "axis1", "rest": 1}}}, "rest: 1, must be 0, or -1"),
        ({"axes": {"forward": 3}}, "3, must be a mapping"),
        ({"buttons": {"a": "launch"}}, "buttons.a: 'launch', allowed are capture"),
        ({"buttons": {7: "hold"}}, "buttons: 7 is no part of a gamepad"),
        ({"dead_zone": 1}, "dead_zone: 1, must be a number from 0 to 0.9"),
        ({"pad": 5}, "pad: 5, must be part of a gamepad's name"),
    ],
)
def test_a_wrong_mapping_is_refused_in_one_line(tree: object, words: str) -> None:
    """What, where and what would be right."""
    with pytest.raises(InputError) as told:
        mapping_of(tree, "pads.yaml")
    assert words in str(told.value) and str(told.value).startswith("pads.yaml") and "\n" not in str(told.value)


def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path) -> None:
    """Absent, or not YAML."""
    path = tmp_path / "pads.yaml"
    with pytest.raises(InputError, match="cannot be read as YAML"):
        load_mapping(path)
    path.write_text("axes: {forward: [", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read as YAML"):
        load_mapping(path)
    path.write_text("pad: some\nbuttons: {a: stop}\n", encoding="utf-8")
    mapping = load_mapping(path)
    mapping.check(state())
    assert mapping.held(state(a=1.0, b=1.0)) == {"a"} and mapping.buttons == {"a": "stop"}
