"""Adversarial photographs: a right model is called right, a wrong one is reported, and a silent one is counted."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.trials.timing import BenchOptions
from wakewise_benchmarks import adversarial_photos, adversarial_scenes
from wakewise_benchmarks.command import show_adversarial_cases
from wakewise_benchmarks.registry import BENCHES


@pytest.mark.slow
def test_some_cases_are_right_or_said(capsys: pytest.CaptureFixture[str]) -> None:
    """A good set is right, mixed-up names are a failure in words; the table has a row each."""
    assert "adversarial-photos" in BENCHES
    found = adversarial_photos.run(BenchOptions(scenarios=("none", "names-mixed-up")))
    assert found["cases"]["none"]["verdict"] == "right" and found["cases"]["none"]["said"] == []
    assert found["cases"]["none"]["off_pct"] < 1.0
    assert found["cases"]["names-mixed-up"]["verdict"] == "said"
    assert (found["right"], found["said"], found["silent_wrongs"]) == (1, 1, 0)
    show_adversarial_cases(found)
    printed = capsys.readouterr().out
    assert "names-mixed-up" in printed and "silently wrong 0" in printed


def test_a_wrong_model_without_a_word_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cameras in the wrong places and no doubt: the bench says so, as it does of a stranger that was given a place."""
    cameras = adversarial_scenes.over(6)
    picture = np.zeros((8, 8, 3), dtype=np.uint8)
    shots = [adversarial_photos.TestPhoto(image=picture, camera=camera) for camera in cameras]
    placed = {f"{k:02d}.png": camera for k, camera in enumerate(cameras)}
    bent = {
        n: adversarial_scenes.SceneCamera(R_WC=c.R_WC, p_WC_m=c.p_WC_m * [1.0, 1.0, 2.0]) for n, c in placed.items()
    }
    for stands, warnings, verdict in ((placed, [], "right"), (bent, [], "silent"), (bent, ["bent"], "said")):
        monkeypatch.setattr(adversarial_photos, "_model", lambda *_, s=stands, d=warnings: (d, s))
        assert (
            adversarial_photos.judge_case(adversarial_photos.AdversarialCase(why="", shots=lambda: shots)).verdict
            == verdict
        )
    strangers = [*shots[:5], adversarial_photos.TestPhoto(image=picture, camera=None)]
    monkeypatch.setattr(adversarial_photos, "_model", lambda *_: ([], placed))
    assert (
        adversarial_photos.judge_case(adversarial_photos.AdversarialCase(why="", shots=lambda: strangers)).verdict
        == "silent"
    )


def test_places_on_a_line_are_judged_by_the_cameras_turns() -> None:
    """Another frame and scale of the same line is right, other steps along it are not."""
    R = adversarial_scenes.over(1)[0].R_WC
    truth = {f"{k}": adversarial_scenes.SceneCamera(R_WC=R, p_WC_m=np.array([0.1 * k, 0.0, 0.0])) for k in range(5)}
    turn = adversarial_scenes.looking(np.array([0.3, 0.2, -0.5]), np.zeros(3)).R_WC
    moved = {
        n: adversarial_scenes.SceneCamera(R_WC=turn @ c.R_WC, p_WC_m=3.0 * turn @ c.p_WC_m + 1.0)
        for n, c in truth.items()
    }
    assert adversarial_photos._error(moved, truth) == pytest.approx((0.0, 0.0), abs=1e-4)
    uneven = {n: adversarial_scenes.SceneCamera(R_WC=R, p_WC_m=c.p_WC_m**2) for n, c in truth.items()}
    assert adversarial_photos._error(uneven, truth)[0] > 5.0


def test_what_was_taken_from_one_place_has_no_error_in_percent(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is no spread to be off by; that is said in `why`, and a model of it is wrong unless it is doubted."""
    placed = {f"{k:02d}.png": camera for k, camera in enumerate(adversarial_scenes.over(4))}
    shots = [
        adversarial_photos.TestPhoto(
            image=np.zeros((8, 8, 3), dtype=np.uint8),
            camera=adversarial_scenes.SceneCamera(R_WC=camera.R_WC, p_WC_m=np.zeros(3)),
        )
        for camera in placed.values()
    ]
    monkeypatch.setattr(adversarial_photos, "_model", lambda *_: ([], placed))
    monkeypatch.setattr(
        adversarial_photos, "CASES", {"spot": adversarial_photos.AdversarialCase(why="", shots=lambda: shots)}
    )
    told = adversarial_photos.run(BenchOptions())
    assert told["cases"]["spot"]["off_pct"] is None and told["silent_wrongs"] == 1
    assert "one place" in told["why"]["cases.spot.off_pct"]


def test_a_case_that_there_is_not_is_refused() -> None:
    """In a line that names those that there are."""
    with pytest.raises(InputError, match="two-lenses"):
        adversarial_photos.run(BenchOptions(scenarios=("quicksand",)))
    assert len(adversarial_photos.CASES) >= 20


@pytest.mark.slow
def test_photographs_are_of_what_stands_there() -> None:
    """A pixel's ray, as long as the distance says, ends on the relief and on the rock."""
    camera = adversarial_scenes.ring(3)[1]
    _, depth = adversarial_scenes.rock()(np.asarray(camera.p_WC_m), camera.rays_W())
    point = camera.p_WC_m + depth[..., None] * camera.rays_W()
    hit = depth > 0.0
    length = np.linalg.norm(point[hit], axis=1)
    assert hit.mean() > 0.2
    assert np.abs(length - adversarial_scenes.rock_radius(point[hit] / length[:, None])).max() < 2e-4
    camera = adversarial_scenes.over(3)[0]
    _, depth = adversarial_scenes.relief()(np.asarray(camera.p_WC_m), camera.rays_W())
    x, y, z = np.moveaxis(camera.p_WC_m + depth[..., None] * camera.rays_W(), -1, 0)
    assert np.abs(z - 0.012 * np.sin(40.0 * x) * np.cos(35.0 * y)).max() < 1e-5
