"""Gamepads and thumbs in a real browser: what counts, and what a lost or a lying device cannot do."""

from __future__ import annotations

import time
from typing import Any

from browser import Page, until
from standin import StandIn

PLUG = """
window.pad = {id: 'Proving pad (Vendor: 1234)', index: 0, connected: true, mapping: 'standard', axes: [0, 0, 0, 0],
              buttons: [...Array(17)].map(() => ({pressed: false, value: 0}))};
window.plugged = [window.pad];
navigator.getGamepads = () => window.plugged;
1
"""


def settled(standin: StandIn, axes: list[float]) -> None:
    until(lambda: (standin.of("sticks") or [{"axes": None}])[-1]["axes"] == axes, f"sticks at {axes}")


def plug(page: Page) -> None:
    page.js(PLUG)
    page.until("document.getElementById('notes').innerText.includes('Gamepad: Proving pad')")


def test_a_gamepad_flies_and_is_at_zero_the_moment_it_is_lost(standin: StandIn, fly: Any) -> None:
    """Up is forward and rise; the dead zone is taken out; pulled out with the sticks over, the next message is zero."""
    page = fly()
    plug(page)
    page.js("pad.axes = [0.05, -1, 0.56, -1]; 1")
    settled(standin, [1, 0, -1, 0.5, 0])
    page.js("plugged = [null]; 1")
    settled(standin, [0, 0, 0, 0, 0])
    page.until("document.getElementById('notes').innerText.includes('Gamepad lost')")
    rate = len(standin.of("sticks", time.monotonic() - 0.5))
    assert rate > 3, "zeros go on, so the helm is kept"


def test_an_axis_counts_once_it_was_seen_at_rest(standin: StandIn, fly: Any) -> None:
    """A stick held over while it is plugged in, a trigger that rests at full, NaN: none of them flies."""
    page = fly()
    page.js(PLUG.replace("axes: [0, 0, 0, 0]", "axes: [-1, -1, NaN, 1]"))
    page.until("document.getElementById('notes').innerText.includes('Gamepad: Proving pad')")
    since_s = time.monotonic()
    until(lambda: len(standin.sticks_since(since_s)) > 4, "sticks")
    assert not any(any(axes) for axes in standin.sticks_since(since_s))
    page.js("pad.axes = [-1, 0, NaN, 1]; 1")
    until(lambda: len(standin.sticks_since(since_s)) > 8, "sticks")
    page.js("pad.axes = [-1, -1, NaN, 1]; 1")
    settled(standin, [1, 0, 0, 0, 0])


def test_buttons_press_once_and_stop_takes_all_out_of_the_hand(standin: StandIn, fly: Any) -> None:
    """Held down is one press; B stops, after which even the tilt that is held counts only when pressed anew."""
    page = fly()
    plug(page)
    page.js("pad.buttons[0].pressed = true; 1")
    until(lambda: [m["what"] for m in standin.of("press")] == ["operator", "capture"], "a capture")
    page.js("pad.buttons[12].pressed = true; 1")
    settled(standin, [0, 0, 0, 0, 1])
    page.js("pad.buttons[1].pressed = true; 1")
    until(lambda: standin.settings["mode"] == "hold", "hold")
    settled(standin, [0, 0, 0, 0, 0])
    assert [m["what"] for m in standin.of("press")] == ["operator", "capture", "hold"]
    page.js("pad.buttons[12].pressed = false; 1")
    time.sleep(0.2)
    page.js("pad.buttons[12].pressed = true; 1")
    settled(standin, [0, 0, 0, 0, 1])


def test_a_pad_that_nobody_has_mapped_is_not_flown(standin: StandIn, fly: Any) -> None:
    """Neither sticks nor buttons of a pad without the standard mapping; one that has it is taken before it."""
    page = fly()
    page.js(PLUG.replace("mapping: 'standard'", "mapping: ''"))
    page.until("document.getElementById('notes').innerText.includes('This gamepad is not flown')")
    page.js("pad.axes = [-1, -1, 1, 1]; pad.buttons[9].pressed = pad.buttons[12].pressed = true; 1")
    since_s = time.monotonic()
    until(lambda: len(standin.sticks_since(since_s)) > 8, "sticks")
    assert not any(any(axes) for axes in standin.sticks_since(since_s))
    assert [m["what"] for m in standin.of("press")] == ["operator"]
    page.js(
        "plugged.push({...pad, index: 1, id: 'Known pad', mapping: 'standard', axes: [0, 0, 0, 0], buttons: []}); 1"
    )
    page.until("document.getElementById('notes').innerText.includes('Gamepad: Known pad')")
    page.js("plugged[1].axes = [0, -1, 0, 0]; 1")
    settled(standin, [1, 0, 0, 0, 0])


def test_thumbs_fly_and_letting_go_is_zero(standin: StandIn, fly: Any) -> None:
    """Two fingers on two sticks, upright and sideways; a touch that the system takes away lets go, too."""
    page = fly("", 390, 844, phone=True)
    left, right = "[data-stick=left]", "[data-stick=right]"
    page.touch("touchStart", [page.place(left), page.place(right)])
    page.touch("touchMove", [page.place(left, 0.0, -0.9), page.place(right, 0.9, 0.0)])
    settled(standin, [1, 0, 0, 1, 0])
    page.touch("touchEnd", [])
    settled(standin, [0, 0, 0, 0, 0])
    page.size(844, 390, phone=True)
    page.touch("touchStart", [page.place(right, 0.0, -0.9)])
    settled(standin, [0, 0, -1, 0, 0])
    page.touch("touchCancel", [])
    settled(standin, [0, 0, 0, 0, 0])


def test_stop_is_one_touch_that_also_drops_the_sticks(standin: StandIn, fly: Any) -> None:
    """A thumb that stays on its stick no longer flies after Stop."""
    page = fly("", 390, 844, phone=True)
    thumb = page.place("[data-stick=left]", 0.0, -0.9)
    page.touch("touchStart", [thumb])
    settled(standin, [1, 0, 0, 0, 0])
    page.touch("touchStart", [thumb, page.place("#stop")])
    until(lambda: standin.settings["mode"] == "hold", "hold")
    settled(standin, [0, 0, 0, 0, 0])
    page.touch("touchEnd", [])
