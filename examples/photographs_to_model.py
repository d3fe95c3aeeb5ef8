"""How do my photographs become a model, and how good is it?"""

import sys
from pathlib import Path

import numpy as np

import wakewise as ww
from wakewise_paper.photo_sets import planned_views, write_photos

out = Path("runs/photographs")
if sys.argv[1:]:  # a folder of photographs and, for scale, a CSV of camera centres: name, x_m, y_m, z_m
    cameras = sys.argv[2] if sys.argv[2:] else None
    print(ww.reconstruct(sys.argv[1], out / "model", reference_cameras=cameras).summary())
else:  # photographs of a coral, rendered, so that the truth is known
    small = {"mission.views": (12, 9, 6), "imaging.width": 640, "imaging.height": 480}
    scenario = ww.Scenario.preset("quick", **small)
    target, rng = scenario.parts().target, np.random.default_rng(1)
    views = planned_views(target, scenario.mission, scenario.imaging.exposure_s, rng)
    photos = write_photos(out, views, None, scenario.imaging, target).folder
    settings, region = scenario.reconstruction, (target.centre_W_m, 1.25 * target.radius_m)
    centres = out / "poses.csv"
    print(ww.reconstruct(photos, out / "model", settings=settings, reference_cameras=centres, region=region).summary())
    score = ww.evaluate(out / "model" / "dense.ply", target.mesh, bed_z_m=target.bed_z_m)
    print(f"against the true surface: {score.rmse_mm:.2f} mm rms, {score.completeness_pct:.0f} % complete")
