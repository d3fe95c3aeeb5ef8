"""One photograph of the quick preset, clean water."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from wakewise.experiments.benches.cases import TARGET
from wakewise.experiments.benches.timing import BenchOptions
from wakewise.imaging import ImagingSettings, Scene, photograph
from wakewise.missions import MissionSettings, plan_route


def run(options: BenchOptions) -> dict[str, Any]:
    """One photograph of the quick preset, clean water."""
    scene, settings = Scene.build(TARGET, 0), ImagingSettings()
    route = plan_route(TARGET.centre_W_m, MissionSettings())
    pose = route.X_WC_planned[0]
    rng = np.random.default_rng(0)
    photograph(scene, settings.camera(), [pose], None, settings, rng)
    wall, cpu = time.perf_counter(), time.process_time()
    for pose in route.X_WC_planned[:8]:
        photograph(scene, settings.camera(), [pose], None, settings, rng)
    return {
        "frame_s": (time.perf_counter() - wall) / 8,
        "frame_cpu_s": (time.process_time() - cpu) / 8,
        "pixels": settings.width * settings.height,
    }
