"""Photographs out of films."""

import cv2
import numpy as np
import pytest
from relief import texture

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.photos.video_frames import (
    choose_frames,
    is_film,
    movement,
    sharpness_of,
    take_frames,
)


def film(path, shifts, blurred=(), size=(960, 720)):
    """A camera that slides over a texture, each frame by this many px; some frames blurred."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 12.0, size)
    assert writer.isOpened()
    tex = np.tile((255 * texture()).astype(np.uint8), (2, 5))
    for k, shift in enumerate(shifts):
        x = int(shift)
        frame = tex[100 : 100 + size[1], x : x + size[0]]
        if k in blurred:
            frame = cv2.GaussianBlur(frame, (0, 0), 8.0)
        writer.write(cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR))
    writer.release()


def test_sharp_frames_a_tenth_of_the_picture_apart_are_taken(tmp_path):
    """A camera at 24 px a frame: one frame per 96 px, none of the blurred; a second call reads what is there."""
    path = tmp_path / "dive.mp4"
    blurred = {0, 4, 9, 12, 13, 21, 28, 33}
    film(path, 24 * np.arange(48), blurred)
    folder, said = take_frames(path, tmp_path / "out")
    files = sorted(p.name for p in folder.iterdir())
    assert files == [f"frame_{n:06d}.jpg" for n in said.numbers]
    assert said.frames == said.looked_at == 48
    assert said.blurred == len(blurred)
    assert not blurred & set(said.numbers)
    assert 10 <= said.taken <= 13
    assert np.diff(said.numbers).min() >= 2
    assert said.moved_widths == pytest.approx(24 * 47 / 960, rel=0.1)
    assert said.motion_px_s == pytest.approx(288.0, rel=0.15)
    assert said.skew_px == pytest.approx(0.02 * said.motion_px_s)
    before = (folder / files[0]).stat().st_mtime_ns
    assert take_frames(path, tmp_path / "out")[1] == said
    assert (folder / files[0]).stat().st_mtime_ns == before
    assert "not undone" in said.lines()[1]


def test_films_that_give_no_photographs_are_named(tmp_path):
    """No film, a film without frames that can be read, a camera that stands still: one line, no folder left."""
    broken = tmp_path / "a.mp4"
    broken.write_bytes(b"\x00\x00\x00\x18ftypmp42 and nothing else" * 20)
    with pytest.raises(InputError, match="codec is not known"):
        take_frames(broken, tmp_path / "one")
    still = tmp_path / "still.mp4"
    film(still, np.zeros(30))
    with pytest.raises(InputError, match="a camera that moves"):
        take_frames(still, tmp_path / "two")
    assert not (tmp_path / "one" / "frames").exists()
    assert not (tmp_path / "two" / "frames").exists()
    assert is_film(still)
    assert not is_film(tmp_path)


def test_the_sharpest_of_each_stretch_is_chosen():
    """One frame a step, and never two next to each other, at a pace that changes."""
    rng = np.random.default_rng(0)
    way = np.cumsum(rng.uniform(0.0, 0.04, 300))
    sharp = rng.uniform(0.6, 1.0, 300)
    chosen = choose_frames(way, sharp, 0.1)
    assert len(chosen) == pytest.approx((way[-1] - way[0]) / 0.1, abs=2)
    assert np.diff(way[chosen]).min() >= 0.03
    assert np.diff(way[chosen]).max() <= 0.2
    assert sharp[chosen].mean() > sharp.mean() + 0.05


def test_movement_and_sharpness_are_what_they_say():
    """A shift comes back in px; blur lowers sharpness, more light does not."""
    tex = (255 * texture()).astype(np.uint8)
    assert movement(tex[100:300, 100:400], tex[103:303, 104:404]) == pytest.approx(5.0, abs=0.1)
    assert movement(np.zeros((100, 100), np.uint8), np.zeros((100, 100), np.uint8)) is None
    plain = sharpness_of(tex)
    assert sharpness_of(cv2.GaussianBlur(tex, (0, 0), 2.0)) < 0.4 * plain
    assert sharpness_of((tex // 2).astype(np.uint8)) == pytest.approx(plain, rel=0.1)
