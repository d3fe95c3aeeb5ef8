"""A page that is told nonsense goes on, and a page that is slow or frozen harms nobody."""

from __future__ import annotations

import struct
import time
from typing import Any

from browser import until
from standin import StandIn

NOTHING = dict.fromkeys(
    ("time_s", "mode", "settings", "controls", "thrusts_N", "commanded_m_s", "velocity_m_s", "deviation_pct",
     "disturbance", "direct_disturbance", "rms_m_s", "direct_rms_m_s", "saved_pct", "predicted_m_s", "true_m_s",
     "depth_m", "roll_deg", "pitch_deg", "heading_deg",
     "tilt_deg", "power_W", "energy_J", "position_W_m", "goal_W_m", "coverage", "photos", "loop", "fallback", "helm",
     "spectators", "target")
)  # fmt: skip
ODD = (
    "", "not JSON", "null", "[]", "7", '"state"', "{}", '{"type": 3}', '{"type": "unheard of"}', '{"type": "_"}',
    '{"type": "__proto__"}',
    {"type": "state"}, {"type": "state", **NOTHING}, {"type": "state", **dict.fromkeys(NOTHING, "x")},
    {"type": "state", **{name: [] for name in NOTHING}},
    {"type": "state", **{name: {"a": [1, None]} for name in NOTHING}},
    {"type": "state", "thrusts_N": [None, "x", 1e308], "predicted_m_s": [1e308, None, -5, "x"], "true_m_s": [],
     "coverage": {"share": 1e9, "patches": [None, "x", -7, 1e308], "next": {"position_W_m": [0], "words": {}}}},
    {"type": "state", "target": {"status": "toString"}},
    {"type": "state", "target": {"status": ["lost"], "outline": 3}},
    {"type": "state", "target": {"status": "lost", "outline": {"u": "x", "v": 1e308, "radius": -1}, "distance_m": "x"}},
    {"type": "state", "target": {"status": "lost", "outline": {"u": 1e308, "v": 0, "radius": 1e308}, "trouble": {}}},
    {"type": "welcome"}, {"type": "welcome", "vehicle": None, "target": None, "settings": None, "scenario": None},
    {"type": "welcome", "vehicle": {"thrusters": [None, {}, {"limit_N": "x", "name": 3}]},
     "scene_url": "javascript:alert(1)",
     "target": {"points_W_m": [None, [1], [1, 2, "x"], [1, 2, 3]], "centre_W_m": "x", "radius_m": -1},
     "settings": {"ranges": {"w_track": [9, 1], "gain": "x"}, "w_track": "x"}},
    {"type": "helm", "yours": "yes", "lease": 5, "holder": {}, "asked_by": "x", "why": []},
    {"type": "note"}, {"type": "note", "level": "loud", "text": "<img src=x onerror='window.broken=1'>", "time_s": "x"},
    b"", b"\x01", struct.pack("<II", 999, 0), struct.pack("<II", 998, 0) + b"\xff\xd8\xffno picture at all",
)  # fmt: skip


NOTES_ITS_STICKS = """(() => {
  window.sent = [];
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (message) {
    if (JSON.parse(message).type === "sticks") window.sent.push(performance.now());
    return send.call(this, message);
  };
})()"""
"""A page that keeps when it sent its sticks, in ms."""


def test_nonsense_from_the_server_breaks_nothing(standin: StandIn, spectate: Any) -> None:
    """Each odd message is survived without an exception, and the next good state is shown."""
    page = spectate()
    for message in ODD:
        standin.tell(message)
    until(lambda: {"type": "seen", "frame": 998} in standin.of("seen"), "the broken picture to be acknowledged")
    # The stand-in tells its state ten times a second all the while.
    page.until("document.querySelector('[data-field=depth]').innerText.endsWith('m')")
    assert page.js("window.broken === undefined && document.querySelector('#notes img') === null")
    assert page.js("document.getElementById('scene-button').hidden")
    assert page.complaints() == []


def test_pictures_come_one_at_a_time_and_go_on_after_a_broken_one(standin: StandIn, spectate: Any) -> None:
    """Each picture is acknowledged by its number once it is decoded, which is what the next one waits for."""
    page = spectate()
    until(lambda: len(standin.of("seen")) > 3, "pictures")
    numbers = [m["frame"] for m in standin.of("seen")]
    assert numbers == sorted(set(numbers))
    assert page.js("document.getElementById('camera').width") == 160


def test_a_frozen_page_sends_no_sticks_and_comes_back(standin: StandIn, fly: Any) -> None:
    """While its one thread is stuck nothing is sent, so the server centres the sticks; afterwards it goes on."""
    page = fly()
    page.down("KeyW")
    until(lambda: any(standin.sticks_since(0)[-1]), "to fly")
    page.js(NOTES_ITS_STICKS)
    before_s = time.monotonic()
    page.js("(() => { const end = performance.now() + 900; while (performance.now() < end); window.freed = end; })()")
    stuck = [t for t in standin.times("sticks", before_s) if t < before_s + 0.8]
    assert len(stuck) < 5
    after_s = time.monotonic()
    until(lambda: len(standin.sticks_since(after_s)) > 5, "sticks again")
    # The queue that piled up is small: a timer that was late fires once. By the page's clock, as a busy server reads
    # several at once.
    assert page.js("window.sent.length") > 5
    assert page.js("window.sent.filter((t) => t > window.freed && t < window.freed + 40).length") < 6


def test_a_wrong_token_is_said_and_not_tried_again(standin: StandIn, browser: Any) -> None:
    """The token comes from the address' fragment; a wrong one ends in words, not in a loop."""
    standin.token = "right"
    page = browser.open(standin.url + "#token=wrong")
    page.until("document.body.dataset.link === 'refused'")
    assert page.text("#banner-what") == "Not let in"
    time.sleep(1.0)
    assert [m["token"] for m in standin.of("hello")] == ["wrong"]
    page.close()
    page = browser.open(standin.url + "#token=right")
    page.until("document.body.dataset.link === 'up'")
    page.close()


def test_while_the_flight_is_made_silence_is_no_alarm(standin: StandIn, spectate: Any) -> None:
    """Until there is a state, the page says what is being prepared; later, silence is told."""
    page = spectate()
    standin.quiet = True
    standin.tell({"type": "welcome", "preparing": "reading kernels"})
    page.until("document.getElementById('banner-more').innerText === 'reading kernels'")
    time.sleep(2.2)
    assert page.js("document.body.dataset.link") == "up"
    standin.tell({"type": "welcome", "preparing": None})
    page.until("document.body.dataset.link === 'silent'")
    standin.quiet = False
    page.until("document.body.dataset.link === 'up'")
