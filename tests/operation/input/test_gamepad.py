"""Gamepads by SDL, on SDL's own virtual ones: plugged in, flown, pulled out, found again."""

import time

import pytest
from virtual_pad import VirtualPad, sdl, until

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.gamepad import Gamepad
from wakewise.operation.teleop.input.pad_mapping import mapping_of

sdl()  # skips where there is none


def axes(pad: Gamepad) -> list[float] | None:
    controls = pad.read(0.0)
    return None if controls is None else controls.axes.tolist()


def test_a_gamepad_flies_and_its_buttons_press_once() -> None:
    """Left stick forward and sideways, right stick turn and depth, the cross tilts; a button held presses once."""
    with Gamepad() as hands:
        assert axes(hands) is None and hands.name is None
        pad = VirtualPad()
        until(lambda: axes(hands) == [0.0] * 5)
        pad.axis(1, -1.0)
        pad.axis(0, 0.05)
        pad.axis(2, 0.56)
        pad.axis(3, 1.0)
        pad.button(11, True)
        until(lambda: axes(hands) == pytest.approx([1.0, 0.0, 1.0, 0.5, 1.0], abs=1e-3))
        pad.button(0, True)
        pressed: list[str] = []

        def heard() -> bool:
            controls = hands.read(0.0)
            pressed.extend(() if controls is None else controls.pressed)
            return "capture" in pressed and "gain_up" in pressed

        pad.button(10, True)
        until(heard)
        assert sorted(pressed) == ["capture", "gain_up"]
        pad.unplug()
        until(lambda: axes(hands) is None)


def test_a_lost_gamepad_is_nobody_until_it_is_back_and_centred() -> None:
    """Pulled out mid-flight: nobody at the sticks. Back with a stick held over: still nobody, until it was let go."""
    with Gamepad() as hands:
        pad = VirtualPad()
        until(lambda: axes(hands) is not None)
        pad.axis(1, -1.0)
        until(lambda: (axes(hands) or [0.0])[0] == 1.0)
        pad.unplug()
        until(lambda: axes(hands) is None)
        pad = VirtualPad(held={1: -1.0})
        until(lambda: hands.name is not None)
        time.sleep(0.1)
        assert axes(hands) is None
        pad.axis(1, 0.0)
        until(lambda: axes(hands) == [0.0] * 5)
        assert [words.split(": ")[1].split(";")[0] for _, words in hands.notes()] == [
            "found", "sticks are centred and have effect", "lost", "found", "sticks are centred and have effect",
        ]  # fmt: skip
        pad.unplug()
        until(lambda: hands.name is None)


def test_a_trigger_that_rests_at_its_end_does_not_fly() -> None:
    """A pad that SDL does not know, flown by numbers: until each stick was seen centred nobody is there."""
    mapping = mapping_of({"axes": {"forward": "-axis1", "right": "axis0", "turn": "axis2", "tilt": "hat0up",
                                   "down": {"of": "axis3", "rest": -1}}, "buttons": {"button0": "hold"}})  # fmt: skip
    with Gamepad(mapping) as hands:
        pad = VirtualPad(known=False, axes=4, buttons=2)
        until(lambda: hands.name is not None)
        assert axes(hands) is None  # a trigger that was never touched says 0, half way down
        pad.axis(3, -1.0)
        until(lambda: axes(hands) == [0.0] * 5)
        pad.axis(3, 1.0)
        until(lambda: (axes(hands) or [0.0] * 5)[2] == pytest.approx(1.0, abs=1e-3))
        pad.unplug()
        until(lambda: axes(hands) is None)


def test_a_mapping_for_another_pad_is_refused() -> None:
    """By name, or because the pad lacks what it asks for: said in one line, and the pad does not fly."""
    for tree, words in (
        ({"pad": "Extreme 3D"}, "is for 'Extreme 3D'"),
        ({"buttons": {"button99": "hold"}}, "button99"),
    ):
        with Gamepad(mapping_of(tree, "pads.yaml")) as hands:
            pad = VirtualPad()
            until(lambda: bool(hands._refused))
            with pytest.raises(InputError, match=rf"^gamepad '.*': pads.yaml .*{words}") as told:
                hands.check()
            assert "\n" not in str(told.value) and axes(hands) is None
            pad.unplug()
            until(lambda: not hands._refused)
