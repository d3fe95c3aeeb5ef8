"""Which frames of a firmware move the vehicle."""

from hypothesis import given
from hypothesis import strategies as st

from wakewise_ardusub.physics.physics import FrameCounter

ONE, TWO = ("127.0.0.1", 40000), ("127.0.0.1", 40001)


def _after(*frames: int) -> tuple[FrameCounter, list[str]]:
    counted, verdicts = FrameCounter(), []
    for k, frame in enumerate(frames):
        counted, verdict = counted.take(frame, ONE, 0.0025 * k)
        verdicts.append(verdict)
    return counted, verdicts


def test_a_repeat_moves_nothing() -> None:
    """It is answered again, which costs no step."""
    counted, verdicts = _after(1, 2, 2, 3)
    assert verdicts == ["begin", "step", "repeat", "step"]
    assert (counted.stepped, counted.repeats, counted.lost) == (3, 1, 0)


def test_a_gap_is_one_step_and_counted() -> None:
    """Frames that never came are lost, and time does not leap."""
    counted, verdicts = _after(1, 2, 6)
    assert verdicts[-1] == "step"
    assert counted.lost == 3


def test_a_count_that_begins_anew_is_a_firmware_that_does() -> None:
    """The vehicle is set back; one that came late is left out."""
    assert _after(500, 501, 499)[1] == ["begin", "step", "late"]
    counted, verdicts = _after(500, 501, 1, 2)
    assert verdicts[2:] == ["begin", "step"]
    assert counted.starts == 2


def test_a_second_firmware_waits_until_the_first_is_silent() -> None:
    """Two that fly one vehicle would each see the other's thrusts."""
    counted, _ = FrameCounter().take(10, ONE, 0.0)
    counted, verdict = counted.take(1, TWO, 0.5)
    assert verdict == "other"
    assert counted.strangers == 1
    counted, verdict = counted.take(2, TWO, 1.2)
    assert verdict == "begin"


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.sampled_from([ONE, TWO]), st.floats(0.0, 2.0))))
def test_every_frame_is_counted_once(frames: list[tuple[int, tuple[str, int], float]]) -> None:
    """Whatever comes: stepped, repeated, late or a stranger's."""
    counted, now_s = FrameCounter(), 0.0
    for frame, sender, wait_s in frames:
        now_s += wait_s
        counted, _ = counted.take(frame, sender, now_s)
    assert counted.stepped + counted.repeats + counted.late + counted.strangers == len(frames)
