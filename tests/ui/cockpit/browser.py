"""A headless Chromium driven by its DevTools protocol: what the tests of the page need of it, and no more."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

CHROMIUM = shutil.which("chromium")
NO_BROWSER = "no chromium here: `make setup` gets one where it may"
SWITCHES = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--no-first-run", "--mute-audio",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
    "--disable-dev-shm-usage", "--no-proxy-server", "--hide-scrollbars", "--force-color-profile=srgb",
)  # fmt: skip
KEYS = {
    "Space": (" ", 32),
    "Enter": ("Enter", 13),
    "Escape": ("Escape", 27),
    "ArrowUp": ("ArrowUp", 38),
    "Tab": ("Tab", 9),
}
PATIENCE_S = 20.0


def until(true: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> Any:
    """Wait for something; what it came to."""
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        value = true()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"waited {patience_s:.0f} s for {what}")


class Browser:
    """Chromium with a fresh profile; `open` gives pages."""

    def __init__(self) -> None:
        assert CHROMIUM is not None, NO_BROWSER
        self._profile = Path(tempfile.mkdtemp(prefix="chromium-"))
        self._process = subprocess.Popen(
            [CHROMIUM, *SWITCHES, f"--user-data-dir={self._profile}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        port_file = self._profile / "DevToolsActivePort"
        lines = until(lambda: port_file.is_file() and port_file.read_text().split(), "chromium to start", 60.0)
        # Without pings of its own: they draw from `random` in a thread, and Hypothesis sees any such draw in its tests.
        self._socket: ClientConnection = connect(
            f"ws://127.0.0.1:{lines[0]}{lines[1]}", max_size=None, proxy=None, ping_interval=None
        )
        self._number = 0
        self._answers: dict[int, dict[str, Any]] = {}
        self.events: list[dict[str, Any]] = []

    def open(self, url: str, width: int = 1280, height: int = 800, *, phone: bool = False, dark: bool = False) -> Page:
        """A new page of this size in front of all others."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, target, session)
        page.call("Page.enable")
        page.call("Runtime.enable")
        page.size(width, height, phone=phone)
        page.colours(dark)
        page.front()
        page.go(url)
        return page

    def call(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """One command of the protocol, waited for."""
        self._number += 1
        number = self._number
        message: dict[str, Any] = {"id": number, "method": method, "params": params}
        if session is not None:
            message["sessionId"] = session
        self._socket.send(json.dumps(message))
        while number not in self._answers:
            self._hear(PATIENCE_S)
        answer = self._answers.pop(number)
        if "error" in answer:
            raise AssertionError(f"{method}: {answer['error']}")
        return answer["result"]

    def _hear(self, timeout_s: float) -> None:
        message = json.loads(self._socket.recv(timeout=timeout_s))
        if "id" in message:
            self._answers[message["id"]] = message
        else:
            self.events.append(message)

    def close(self) -> None:
        self._socket.close()
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(10)
        shutil.rmtree(self._profile, ignore_errors=True)


class Page:
    """One tab."""

    def __init__(self, browser: Browser, target: str, session: str) -> None:
        self._browser, self.target, self._session = browser, target, session

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        return self._browser.call(method, self._session, **params)

    def go(self, url: str) -> None:
        self.call("Page.navigate", url=url)
        self.until("document.readyState === 'complete'")

    def js(self, expression: str) -> Any:
        """Value of a JavaScript expression; its exception is the test's."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise AssertionError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def until(self, expression: str, patience_s: float = PATIENCE_S) -> Any:
        """Wait until an expression is true, on a page that may still be loading."""
        return until(lambda: self.js(f"document.body && ({expression})"), expression, patience_s)

    def text(self, selector: str) -> str:
        return str(self.js(f"document.querySelector({json.dumps(selector)}).innerText"))

    # ---- hands

    def down(self, code: str, *, repeat: bool = False) -> None:
        self._key("keyDown", code, repeat)

    def up(self, code: str) -> None:
        self._key("keyUp", code, False)

    def press(self, code: str) -> None:
        self.down(code)
        self.up(code)

    def _key(self, kind: str, code: str, repeat: bool) -> None:
        key, number = KEYS.get(code, (code[-1].lower(), ord(code[-1])))
        text = {"text": "\r"} if code == "Enter" and kind == "keyDown" else {}
        self.call(
            "Input.dispatchKeyEvent",
            type=kind,
            code=code,
            key=key,
            windowsVirtualKeyCode=number,
            autoRepeat=repeat,
            **text,
        )

    def place(self, selector: str, dx: float = 0.0, dy: float = 0.0) -> tuple[float, float]:
        """Middle of an element in pixels, moved by shares of its half size."""
        x, y, w, h = self.js(
            f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            " return [b.x, b.y, b.width, b.height]; })()"
        )
        assert w > 0 and h > 0, f"{selector} is not in sight"
        return x + w / 2 + dx * w / 2, y + h / 2 + dy * h / 2

    def click(self, selector: str) -> None:
        x, y = self.place(selector)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def touch(self, kind: str, points: list[tuple[float, float]]) -> None:
        """Fingers that are down after "touchStart", "touchMove", "touchEnd" or "touchCancel"."""
        self.call(
            "Input.dispatchTouchEvent",
            type=kind,
            touchPoints=[{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)],
        )

    # ---- what the page finds itself in

    def size(self, width: int, height: int, *, phone: bool = False, scale: float = 0.0) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=phone
        )
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone, maxTouchPoints=5 if phone else 1)

    def front(self) -> None:
        """Bring it before all others, which are then hidden and without focus, as in any browser."""
        self.call("Page.bringToFront")

    def always_front(self) -> None:
        """As if on a screen of its own, whatever else is open."""
        self.call("Emulation.setFocusEmulationEnabled", enabled=True)

    def colours(self, dark: bool) -> None:
        self.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}],
        )

    def shot(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def complaints(self) -> list[str]:
        """Errors on the page's console, and exceptions nobody caught."""
        self.js("0")
        found = []
        for event in self._browser.events:
            if event.get("sessionId") != self._session:
                continue
            if event["method"] == "Runtime.exceptionThrown":
                found.append(str(event["params"]["exceptionDetails"]))
            if event["method"] == "Runtime.consoleAPICalled" and event["params"]["type"] == "error":
                found.append(str(event["params"]["args"]))
        return found

    def close(self) -> None:
        """Close the tab and wait until it is gone: the browser answers before."""
        self._browser.call("Target.closeTarget", targetId=self.target)
        until_s = time.monotonic() + PATIENCE_S
        while self.alive():
            assert time.monotonic() < until_s, "the tab does not close"
            time.sleep(0.02)

    def alive(self) -> bool:
        """Whether the tab is still there."""
        targets = self._browser.call("Target.getTargets")["targetInfos"]
        return any(one["targetId"] == self.target for one in targets)
