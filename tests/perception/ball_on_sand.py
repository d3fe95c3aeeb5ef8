"""Pictures of a ball with dots on a bed of sand, drawn fast enough for a live flight."""

from __future__ import annotations

import cv2
import numpy as np

from wakewise.core.geometry import Pose
from wakewise.perception import CalibratedCamera
from wakewise.perception.feature_tracks import Grey

CAMERA = CalibratedCamera(width=480, height=360, fx=420.0, fy=420.0, cx=239.5, cy=179.5)
BED_M, CENTRE_W_M, RADIUS_M = 1.5, np.array([0.0, 0.0, 1.42]), 0.1


class BallOnSand:
    """Pictures of a ball with dots on a bed of sand."""

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        sand = cv2.GaussianBlur(rng.uniform(0.0, 255.0, (800, 800)), (0, 0), 1.5)
        self.sand = cv2.normalize(sand, None, 40, 160, cv2.NORM_MINMAX).astype(np.uint8)
        way = rng.normal(size=(900, 3))
        ball = CENTRE_W_M + RADIUS_M * way / np.linalg.norm(way, axis=1, keepdims=True)
        self.ball_W_m, self.greys = ball[ball[:, 2] < BED_M], rng.integers(20, 255, 900)

    def grey(self, X_WC: Pose) -> Grey:
        """The picture of the camera at a pose, shape (360, 480)."""
        # From texels of 4 mm to the bed, to the camera, to pixels.
        bed = np.array([[0.004, 0.0, -1.6], [0.0, 0.004, -1.6], [0.0, 0.0, 1.0]])
        plane = np.column_stack([X_WC.R.T[:, 0], X_WC.R.T[:, 1], X_WC.R.T @ (np.array([0.0, 0.0, BED_M]) - X_WC.p_m)])
        K = np.array([[CAMERA.fx, 0.0, CAMERA.cx], [0.0, CAMERA.fy, CAMERA.cy], [0.0, 0.0, 1.0]])
        image = cv2.warpPerspective(self.sand, K @ plane @ bed, (CAMERA.width, CAMERA.height), borderValue=90)
        away = float(np.linalg.norm(CENTRE_W_M - X_WC.p_m))
        middle = np.rint(CAMERA.pixels(((CENTRE_W_M - X_WC.p_m) @ X_WC.R)[None])[0]).astype(int)
        cv2.circle(image, middle.tolist(), round(CAMERA.fx * RADIUS_M / away), 120, -1)
        near = (self.ball_W_m - CENTRE_W_M) @ (X_WC.p_m - CENTRE_W_M) > RADIUS_M**2
        p_C = (self.ball_W_m[near] - X_WC.p_m) @ X_WC.R
        for (u, v), z, grey in zip(CAMERA.pixels(p_C), p_C[:, 2], self.greys[: len(near)][near], strict=True):
            at = (round(16 * float(u)), round(16 * float(v)))
            cv2.circle(image, at, round(16 * CAMERA.fx * 0.004 / float(z)), int(grey), -1, cv2.LINE_AA, 4)
        return np.asarray(image, dtype=np.uint8)


def ball_jpeg(water: BallOnSand, X_WC: Pose, width: int = CAMERA.width) -> bytes:
    """The picture of the camera at a pose, in another width, as a JPEG."""
    fit = cv2.resize(water.grey(X_WC), (width, width * CAMERA.height // CAMERA.width), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", fit)[1].tobytes()
