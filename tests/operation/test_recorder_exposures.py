"""What is kept of an exposure for cameras that roll and that expose automatically."""

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.operation import Scenario, fly, load_scenario
from wakewise.operation.flight_log import ExposureRecord, exposure_arrays, read_exposures, write_exposures
from wakewise.operation.photography import fingerprint, take_photograph
from wakewise.vision.imaging.settings import LONGEST_S

SILT = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=0.1, values=np.zeros((2, 2, 2)))


def record(before=()):
    X = Pose(np.array([0.1, 0.2, 0.3]))
    return ExposureRecord(time_s=1.0, X_WC_true=(X, X), X_WC_est=X, silt=SILT, X_WC_before=before)


def test_views_before_are_kept_where_there_are_any(tmp_path):
    """They come back from the file and count in the fingerprint; without them the file is what it always was."""
    before = tuple(Pose(np.array([k, 0.0, 0.0])) for k in range(3))
    write_exposures(tmp_path / "with.npz", [record(before)], 0.04)
    back = read_exposures(tmp_path / "with.npz")[0]
    np.testing.assert_array_equal([X.p_m for X in back.X_WC_before], [X.p_m for X in before])
    write_exposures(tmp_path / "without.npz", [record()], 0.04)
    assert read_exposures(tmp_path / "without.npz")[0].X_WC_before == ()
    assert not [name for name in exposure_arrays([record()]) if "before" in name]
    assert fingerprint(record(before)) != fingerprint(record())


@pytest.fixture(scope="module")
def flight():
    """The first photographs of a mission that begins at once, by a camera that rolls and exposes automatically."""
    scenario = Scenario.preset("quick", method="dp", **{"mission.approach_m": 0.02, "mission.settle_s": 1.0})
    scenario = scenario.replace(**{"imaging.kind": "rov-video", "imaging.width": 160, "imaging.height": 90})
    return fly(scenario, duration_s=6.0, checked=False)


def test_the_recorder_keeps_poses_over_exposure_and_readout(flight):
    """Poses span the longest exposure and the readout, at the speed at which the vehicle moves; eight lie before."""
    imaging, exposures = flight.parts.scenario.imaging, flight.recorder.exposures
    assert len(exposures) >= 2
    for exposure in exposures:
        first, last = exposure.X_WC_true[0].p_m, exposure.X_WC_true[-1].p_m
        speed_m_s = np.linalg.norm(last - first) / imaging.window_s
        before = np.array([X.p_m for X in exposure.X_WC_before])
        assert len(before) == 8
        step_m_s = np.linalg.norm(before[-1] - before[-2]) / 0.1
        assert speed_m_s == pytest.approx(step_m_s, abs=0.02)
        assert np.linalg.norm(first - before[-1]) < 0.01


@pytest.mark.slow
def test_photographs_do_not_hang_on_each_other(flight, tmp_path):
    """The second photograph is the same to the byte whether the first was made before it, or after, or never."""
    made = []
    for order in ((0, 1), (1, 0)):
        folder = tmp_path / "".join(map(str, order))
        (folder / "images").mkdir(parents=True)
        write_exposures(folder / "exposures.npz", flight.recorder.exposures, 0.0)
        exposures = read_exposures(folder / "exposures.npz")
        for k in order:
            noted = take_photograph(flight.parts, folder, k, exposures[k])
            assert noted["exposure_s"] <= LONGEST_S
            if (second := folder / "images" / "001.jpg").exists():
                made.append(second.read_bytes())
    after, never, before = made
    assert after == never == before


def test_a_kind_of_camera_goes_over_a_preset_and_under_what_is_said(tmp_path):
    """A later layer's kind replaces what lies below, its own fields stand, and `still` takes all of it back."""
    (tmp_path / "mine.yaml").write_text("imaging: {kind: rov-video, readout_s: 0.02}\n")
    mine = load_scenario("quick", tmp_path / "mine.yaml", {})
    assert (mine.imaging.readout_s, mine.imaging.photo_format, mine.imaging.width) == (0.02, "jpeg", 960)
    action = load_scenario("quick", tmp_path / "mine.yaml", {"imaging.kind": "action-4k"})
    assert (action.imaging.readout_s, action.imaging.jpeg_quality) == (0.017, 75)
    assert load_scenario("quick", tmp_path / "mine.yaml", {"imaging.kind": "still"}).imaging.readout_s == 0.0
    again = mine.replace(**{"imaging.lamp": 0.1})
    assert again.imaging.readout_s == 0.02 and again.imaging.kind == "rov-video"
