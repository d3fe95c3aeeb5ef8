"""What a real browser sends of what hands do at the keyboard, and that it stops when nobody looks."""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Any

from browser import Browser, until
from standin import StandIn

SILENCE_S = 0.4


def forward(standin: StandIn, since_s: float, value: float) -> None:
    until(lambda: value in [axes[0] for axes in standin.sticks_since(since_s)], f"forward {value}")


def silent_after_zeros(standin: StandIn, since_s: float) -> None:
    """Zeros came at once, and then nothing more."""
    until(lambda: standin.sticks_since(since_s) and not any(standin.sticks_since(since_s)[-1]), "zeros", 2.0)
    rest_s = time.monotonic()
    time.sleep(SILENCE_S)
    assert standin.sticks_since(rest_s + 0.05) == []


def test_a_page_comes_as_a_spectator_whose_keys_move_nothing(standin: StandIn, spectate: Any) -> None:
    """Without the helm no sticks are sent, whatever is held down."""
    page = spectate()
    assert standin.of("hello") == [{"type": "hello", "token": None, "name": "A pilot", "wants": "watch"}]
    page.down("KeyW")
    page.press("KeyC")
    time.sleep(SILENCE_S)
    assert standin.of("sticks") == standin.of("press") == standin.of("settings") == []
    assert "Nobody has the helm" in page.text("#banner")


def test_sticks_go_out_25_times_a_second_by_a_timer(standin: StandIn, fly: Any) -> None:
    """Held keys are full stick, combined by axis; numbers rise; the rate is that of a timer, not of the screen."""
    page = fly()
    start_s = time.monotonic()
    for code in ("KeyW", "KeyD", "ArrowUp", "KeyQ", "KeyR"):
        page.down(code)
    until(lambda: [1, 1, -1, -1, 1] in standin.sticks_since(start_s), "all five axes")
    page.up("KeyW")
    until(lambda: [0, 1, -1, -1, 1] in standin.sticks_since(start_s), "forward let go")
    time.sleep(1.0)
    messages, times = standin.of("sticks", start_s), standin.times("sticks", start_s)
    assert [m["seq"] for m in messages] == list(range(messages[0]["seq"], messages[0]["seq"] + len(messages)))
    assert 15 <= len(times) / (times[-1] - times[0]) <= 30
    assert all(b["t"] > a["t"] for a, b in pairwise(messages))


def test_space_stops_whatever_has_the_focus(standin: StandIn, fly: Any) -> None:
    """It never presses the button under the focus, and what was held down no longer flies."""
    page = fly()
    start_s = time.monotonic()
    page.down("KeyW")
    forward(standin, start_s, 1)
    page.js("document.getElementById('capture').focus()")
    stop_s = time.monotonic()
    page.press("Space")
    page.down("KeyW", repeat=True)
    until(lambda: standin.of("press", stop_s), "stop")
    assert standin.of("press", stop_s)[0]["what"] == "hold"
    page.until("document.body.dataset.mode === 'hold'")
    time.sleep(SILENCE_S)
    assert not any(standin.sticks_since(stop_s + 0.3)[-1])
    assert [m["what"] for m in standin.of("press", stop_s)] == ["hold"]


def test_stop_by_who_only_watches_takes_the_helm_that_nobody_holds(standin: StandIn, spectate: Any) -> None:
    """An emergency is no time for two buttons."""
    standin.settings["mode"] = "scan"
    page = spectate()
    page.click("#stop")
    until(lambda: standin.settings["mode"] == "hold", "hold")
    assert standin.lease is not None


def test_a_window_left_sends_zeros_at_once_and_then_nothing(standin: StandIn, fly: Any, browser: Browser) -> None:
    """Blurred and hidden; back in front, what is still held down does not fly until it is pressed anew."""
    page = fly()
    start_s = time.monotonic()
    page.down("KeyW")
    forward(standin, start_s, 1)
    left_s = time.monotonic()
    other = browser.open("about:blank")
    silent_after_zeros(standin, left_s)
    assert standin.times("sticks", left_s)[-1] - left_s < 1.5
    other.close()
    page.front()
    back_s = time.monotonic()
    page.down("KeyW", repeat=True)
    until(lambda: len(standin.sticks_since(back_s)) > 5, "sticks again")
    assert not any(any(axes) for axes in standin.sticks_since(back_s))
    page.up("KeyW")
    page.down("KeyW")
    forward(standin, back_s, 1)


def test_a_page_that_froze_flies_nothing_until_pressed_anew(standin: StandIn, fly: Any) -> None:
    """A key, a thumb and a gamepad that were held through a pause of the page are zero after it, repeats or not."""
    page = fly("?touch=1")
    page.js(
        "navigator.getGamepads = () => [window.pad]; window.pad = {id: 'Pad', index: 0, connected: true,"
        " mapping: 'standard', axes: [0, 0, 0, 0], buttons: []}; 1"
    )
    page.until("document.getElementById('notes').innerText.includes('Gamepad: Pad')")
    start_s = time.monotonic()
    page.down("KeyW")
    page.js("pad.axes = [0, 0, 1, 0]; 1")
    x, y = page.place("[data-stick=right]", 0.0, -0.9)
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
    until(lambda: [1, 0, -1, 1, 0] in standin.sticks_since(start_s), "all three")
    page.js("(() => { const end = performance.now() + 600; while (performance.now() < end); })()")
    thawed_s = time.monotonic()
    page.down("KeyW", repeat=True)
    until(lambda: len(standin.sticks_since(thawed_s)) > 10, "sticks")
    assert not any(any(axes) for axes in standin.sticks_since(thawed_s)[1:])
    page.up("KeyW")
    page.down("KeyW")
    forward(standin, thawed_s, 1)


def test_a_lost_connection_is_known_again_by_its_last_lease(standin: StandIn, fly: Any) -> None:
    """After a reload, too, the page tells which helm it had; a page that had none tells nothing."""
    page = fly()
    lease = standin.lease
    standin.drop()
    until(lambda: len(standin.of("hello")) == 2, "to be back")
    page.call("Page.reload")
    until(lambda: len(standin.of("hello")) == 3, "to be loaded")
    assert [m.get("lease") for m in standin.of("hello")] == [None, lease, lease]


def test_a_closed_tab_says_zero_and_gives_the_helm_up(standin: StandIn, fly: Any) -> None:
    """The last sticks are zeros, and the vehicle's server knows that nobody is there."""
    page = fly()
    start_s = time.monotonic()
    page.down("KeyW")
    forward(standin, start_s, 1)
    page.close()
    until(lambda: standin.lease is None, "the helm to be free")
    assert standin.sticks_since(start_s)[-1] == [0, 0, 0, 0, 0]


def test_after_a_reload_the_helm_must_be_asked_for(standin: StandIn, fly: Any) -> None:
    """A page that is loaded again watches."""
    page = fly()
    page.call("Page.reload")
    until(lambda: len(standin.of("hello")) == 2, "a second hello")
    page.until("document.body.dataset.link === 'up' && document.body.dataset.helm === 'free'")
    again_s = time.monotonic()
    page.down("KeyW")
    time.sleep(SILENCE_S)
    assert standin.of("sticks", again_s) == []


def test_a_lost_link_comes_back_as_a_spectator(standin: StandIn, fly: Any) -> None:
    """The page says so, tries again by itself, and flies only after the helm was asked for anew."""
    page = fly()
    page.down("KeyW")
    page.js(
        "window.said = []; const what = document.getElementById('banner-what');"
        "new MutationObserver(() => said.push(what.innerText)).observe(what, {childList: true, subtree: true}); 1"
    )
    standin.drop()
    page.until("said.some((one) => one.startsWith('Link lost: the vehicle holds'))")
    until(lambda: len(standin.of("hello")) == 2, "to be back")
    page.until("document.body.dataset.link === 'up' && document.body.dataset.helm === 'free'")
    back_s = time.monotonic()
    time.sleep(SILENCE_S)
    assert standin.of("sticks", back_s) == []
    page.press("KeyG")
    page.until("document.body.dataset.helm === 'mine'")
    until(lambda: standin.sticks_since(back_s), "sticks")
    assert not any(any(axes) for axes in standin.sticks_since(back_s)), "held before the helm came"


def test_a_second_pilot_gets_the_helm_by_consent(standin: StandIn, fly: Any, spectate: Any) -> None:
    """Who holds it goes on flying while asked, and once it is handed over sends nothing more."""
    ada = fly("?name=Ada")
    ada.always_front()
    ben = spectate("?name=Ben")
    ben.always_front()
    ben.until("document.getElementById('banner-what').innerText === 'Ada has the helm'")
    ben.click("#helm-button")
    ada.until("!document.getElementById('ask').hidden")
    assert ada.text("#ask-text") == "Ben asks for the helm."
    ben.until("document.getElementById('banner-more').innerText.startsWith('asked')")
    asked_s = time.monotonic()
    ada.down("KeyS")
    forward(standin, asked_s, -1)
    ada.click("#ask-no")
    ben.until("!document.getElementById('helm-button').hidden")
    ben.click("#helm-button")
    ada.until("!document.getElementById('ask').hidden")
    ada.click("#ask-yes")
    ben.until("document.body.dataset.helm === 'mine'")
    ada.until("document.body.dataset.helm === 'other'")
    lease = standin.lease
    given_s = time.monotonic()
    ben.down("KeyW")
    forward(standin, given_s, 1)
    time.sleep(SILENCE_S)
    assert {m["lease"] for m in standin.of("sticks", given_s + 0.1)} == {lease}


def test_ending_the_flight_asks(standin: StandIn, fly: Any) -> None:
    """One button alone ends nothing; Space in the question stops the motion, Enter keeps flying."""
    page = fly()
    page.click("#end")
    page.press("Space")
    until(lambda: standin.settings["mode"] == "hold", "hold")
    assert page.js("document.getElementById('end-box').open")
    page.press("Enter")
    page.until("!document.getElementById('end-box').open")
    assert [m["what"] for m in standin.of("press")] == ["operator", "hold"]
    page.click("#end")
    page.click("#end-box .danger")
    until(lambda: standin.of("press")[-1]["what"] == "stop", "the end")


def test_capture_and_the_desk_go_with_the_lease(standin: StandIn, fly: Any) -> None:
    """Keys and buttons ask for the same; sliders send what the server knows as its ranges."""
    page = fly()
    page.press("KeyC")
    page.click("#capture")
    page.press("KeyX")
    page.click("[data-assist=orbit]")
    page.press("BracketRight")
    until(lambda: standin.settings["orbit"] and standin.settings["w_track"] > 5, "the settings")
    page.js(
        "(() => { const d = document.getElementById('w-track'); d.value = 0; d.dispatchEvent(new Event('input')); })()"
    )
    until(lambda: standin.settings["w_track"] == 0.5, "the gentlest")
    page.until("document.getElementById('regime').innerText === 'delicate'")
    assert [m["what"] for m in standin.of("press")] == ["operator", "capture", "capture"]
    assert standin.settings["method"] == "direct"
    assert {m["lease"] for m in standin.of("settings") + standin.of("press")} == {standin.lease}


def test_inside_a_frame_a_click_outside_centres_the_sticks(standin: StandIn, browser: Browser) -> None:
    """As a widget of another ground station the page gives its keys up with the focus, though it stays in sight."""
    page = browser.open(standin.url + "around")
    until(lambda: standin.clients, "the widget")
    x, y = page.place("#f")
    for kind in ("mousePressed", "mouseReleased"):
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    page.press("KeyG")
    until(lambda: standin.of("sticks"), "the helm")
    start_s = time.monotonic()
    page.down("KeyW")
    forward(standin, start_s, 1)
    out_s = time.monotonic()
    page.click("#outside")
    silent_after_zeros(standin, out_s)
    page.close()
