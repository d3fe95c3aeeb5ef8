"""The live picture comes from a process of its own, which may be late, and may end, without harm."""

from __future__ import annotations

import io
import pickle
import time

import cv2
import numpy as np
import pytest

from wakewise.core.errors import StageError
from wakewise.operation import Scenario
from wakewise.ui.cockpit import live_camera
from wakewise.ui.cockpit.live_camera import DRAWN_WITHIN_S, WIDTHS_PX, CameraState, LiveCamera, PictureWidth
from wakewise.vision.imaging import photograph

WIDTH_PX, HEIGHT_PX = 160, 120


@pytest.mark.slow
def test_a_picture_is_the_photograph_but_for_what_is_left_out() -> None:
    """None comes before the scene is lit; then the two differ by noise, flakes and samples: a few grey levels.

    A process that was killed is told of, one that was closed is quiet.
    """
    scenario = Scenario.preset("quick")
    camera = LiveCamera(scenario, widths_px=(WIDTH_PX,))
    parts = scenario.parts()
    view = CameraState(X_WC=parts.start.X_WB @ parts.vehicle.X_BC)
    assert camera.draw(view) is None
    camera.start()
    try:
        assert camera.draw(view, timeout_s=0.0) is None
        settings = parts.scenario.imaging.model_copy(update={"width": WIDTH_PX, "height": HEIGHT_PX})
        rng = np.random.default_rng(1)
        photo = photograph(parts.scene, settings.camera(), (view.X_WC,), None, settings, rng).image
        end_s = time.monotonic() + 120.0
        while (jpeg := camera.draw(view, timeout_s=1.0)) is None:
            assert time.monotonic() < end_s
            time.sleep(0.1)
        picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
        assert picture.shape == (HEIGHT_PX, WIDTH_PX, 3)
        off = np.abs(picture.astype(np.float64) - photo.astype(np.float64))
        assert float(np.median(off)) < 4.0
        assert float(off.mean()) < 6.0
        assert camera._process is not None
        camera._process.kill()
        with pytest.raises(StageError, match="has ended"):
            for _ in range(20):
                camera.draw(view, timeout_s=1.0)
    finally:
        camera.close()
    assert camera.draw(view) is None


def test_it_is_ready_once_a_picture_was_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first picture reads kernels, for seconds: it is drawn before anybody is told that there are pictures."""
    done: list[str] = []

    class Slow:
        def __init__(self, *_: object) -> None:
            done.append("lit")

        def warm(self) -> None:
            done.append("drawn")

    monkeypatch.setattr(live_camera, "PictureRenderer", Slow)
    monkeypatch.setattr(live_camera.os, "nice", lambda _: 0)
    monkeypatch.setattr(live_camera, "write_message", lambda _, message: done.append(message.decode()))
    begin = pickle.dumps((None, None, 480))
    live_camera.serve(io.BytesIO(len(begin).to_bytes(8, "little") + begin), io.BytesIO())
    assert done == ["lit", "drawn", "ready"]


def test_pictures_get_narrower_where_the_cores_are_busy_and_wide_again_where_they_are_not() -> None:
    """By a time that goes with the pixels: to a width that keeps it, without going to and fro, and back."""
    width = PictureWidth()
    assert width.px == WIDTHS_PX[0]

    def flown(widest_takes_s: float) -> list[int]:
        widths = []
        for _ in range(60):
            width.took(widest_takes_s * (width.px / WIDTHS_PX[0]) ** 2)
            widths.append(width.px)
        return widths

    busy = flown(0.13)
    assert 0.13 * (busy[-1] / WIDTHS_PX[0]) ** 2 <= DRAWN_WITHIN_S
    assert busy == sorted(busy, reverse=True)
    assert WIDTHS_PX[-1] < busy[-1] < WIDTHS_PX[0]
    assert flown(10.0)[-1] == WIDTHS_PX[-1]
    free = flown(0.04)
    assert free[-1] == WIDTHS_PX[0]
    assert free == sorted(free)
