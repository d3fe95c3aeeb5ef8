"""The bench of models: every figure it promises, on one small coral."""

import pytest

from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import load_scenario
from wakewise_benchmarks import reconstruction
from wakewise_benchmarks.registry import BENCHES

SMALL = {
    "target.kind": "brain",
    "mission.elevations_deg": [45],
    "mission.views": [14],
    "mission.standoff_m": 0.35,
    "imaging.width": 320,
    "imaging.height": 240,
    "imaging.fov_deg": 50,
    "imaging.samples": 1,
    "reconstruction.mesh_depth": 6,
    "reconstruction.dense_px": 160,
    "reconstruction.dense_zoom": 1.0,
    "reconstruction.stereo_paths": 3,
    "reconstruction.stereo_partners": 2,
    "target.points": 60,
}
"""The least that both ways make a model of; how good it is, other tests ask."""


@pytest.mark.slow
def test_the_bench_has_every_figure_at_the_top_and_per_coral(monkeypatch: pytest.MonkeyPatch) -> None:
    """Accuracy, completeness, times and memory, none missing in clear water; the way without poses beside it."""
    small = load_scenario("quick", None, SMALL)
    monkeypatch.setattr(reconstruction, "stony_kinds", lambda: ("brain",))
    monkeypatch.setattr(reconstruction, "load_scenario", lambda *_: small)
    monkeypatch.setattr(reconstruction.imaging, "run", lambda _: {"frame_s": 0.1})
    assert "reconstruction" in BENCHES
    found = reconstruction.run(BenchOptions())
    promised = {"rmse_mm", "completeness_visible_pct", "stages_s", "total_s", "memory_MB", "render_s_per_frame"}
    for figures in (found, found["corals"]["brain"]):
        assert all(figures[key] is not None for key in promised)
    assert found["why"] == {}
    assert set(found["stages_s"]) == {"match", "map", "dense", "evaluate"}
    one = found["corals"]["brain"]
    assert one["mesh_s"] > 0.0 and one["cpu_ratio"] > 0.0
    assert one["mapping"] == "from known poses" and one["photos_alone"]["mapping"] == "photo by photo"
    assert all(value is not None for value in one["photos_alone"].values())
    assert 50.0 < found["memory_MB"] < 3000.0
