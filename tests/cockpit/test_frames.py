"""The live picture comes from a process of its own, which may be late, and may end, without harm."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest

from wakewise.cockpit.frames import Easel, LiveCamera, View
from wakewise.errors import StageError
from wakewise.operation import Scenario

SCENARIO = Scenario.preset("quick")


@pytest.mark.slow
def test_a_view_becomes_a_jpeg_of_the_size_that_was_asked_for() -> None:
    """Not before its scene is lit; the target is in the middle; a killed process is told of, a closed one is quiet."""
    parts = SCENARIO.parts()
    view = View(X_WC=parts.start.X_WB @ parts.vehicle.X_BC)
    camera = LiveCamera(SCENARIO, width_px=160)
    assert camera.draw(view) is None
    camera.start()
    try:
        assert camera.draw(view, timeout_s=0.0) is None
        end_s = time.monotonic() + 120.0
        while (jpeg := camera.draw(view, timeout_s=1.0)) is None:
            assert time.monotonic() < end_s
            time.sleep(0.1)
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert image.shape == (120, 160, 3)
        assert image.std() > 5.0
        assert camera._process is not None
        camera._process.kill()
        with pytest.raises(StageError, match="has ended"):
            for _ in range(20):
                camera.draw(view, timeout_s=1.0)
    finally:
        camera.close()
    assert camera.draw(view) is None


@pytest.mark.slow
def test_a_picture_is_the_photograph_but_for_what_is_left_out() -> None:
    """At the same size and place the two differ by noise, flakes and samples only: a few grey levels."""
    from wakewise.imaging import photograph

    parts = SCENARIO.parts()
    X_WC = parts.start.X_WB @ parts.vehicle.X_BC
    easel = Easel(SCENARIO, None, 160)
    picture = easel.draw(View(X_WC=X_WC)).astype(np.float64)
    settings = easel.settings
    photo = photograph(parts.scene, settings.camera(), (X_WC,), None, settings, np.random.default_rng(1))
    off = np.abs(picture - photo.image.astype(np.float64))
    assert float(np.median(off)) < 4.0
    assert float(off.mean()) < 6.0
