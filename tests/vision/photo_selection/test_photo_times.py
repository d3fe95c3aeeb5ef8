"""When photographs were taken, by EXIF and by their names."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from wakewise.vision.photo_selection.photo_times import PhotoTime, evened, exif_time, name_time, spread


def _jpeg(**tags: str) -> bytes:
    numbers = {"taken": 0x9003, "part": 0x9291, "zone": 0x9011}
    held = Image.Exif()
    held.get_ifd(0x8769).update({numbers[name]: value for name, value in tags.items()})
    out = io.BytesIO()
    Image.new("RGB", (8, 8)).save(out, "JPEG", exif=held)
    return out.getvalue()


def test_exif_gives_date_parts_of_a_second_and_zone() -> None:
    """2022-08-15 10:30:05.25 at +02:00 is 08:30:05.25 UTC; without a zone the clock counts as UTC."""
    assert exif_time(io.BytesIO(_jpeg(taken="2022:08:15 10:30:05", part="25", zone="+02:00"))) == (
        1_660_552_205.25,
        0.01,
    )
    assert exif_time(io.BytesIO(_jpeg(taken="2022:08:15 10:30:05"))) == (1_660_559_405.0, 1.0)


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff\xe1", _jpeg(), _jpeg(taken="0000:00:00 00:00:00")])
def test_a_picture_without_a_time_gives_none(data: bytes) -> None:
    """Damaged files, files without EXIF and clocks that were never set have no time."""
    assert exif_time(io.BytesIO(data)) is None


@pytest.mark.parametrize(
    ("name", "time_s", "step_s"),
    [
        ("dive_20220815_103005.jpg", 1_660_559_405.0, 1.0),
        ("2022-08-15 10.30.05.jpg", 1_660_559_405.0, 1.0),
        ("IMG_20220815_103005_250.jpg", 1_660_559_405.25, 0.001),
        ("IMG_20220815103005250.jpg", 1_660_559_405.25, 0.001),
        ("2022-08-15T10:30:05.5.png", 1_660_559_405.5, 0.1),
    ],
)
def test_names_give_times(name: str, time_s: float, step_s: float) -> None:
    """The usual patterns of cameras and programs are read."""
    assert name_time(name) == pytest.approx((time_s, step_s))


@pytest.mark.parametrize("name", ["P0001.jpg", "GOPR20221399_999999.jpg", "123456789012345678.jpg"])
def test_names_without_a_time_give_none(name: str) -> None:
    """Numbers and impossible dates are no times."""
    assert name_time(name) is None


def test_photographs_of_one_second_are_spread_over_it() -> None:
    """Three photographs stamped alike by a clock of whole seconds are a third of a second apart."""
    photos = [PhotoTime(name=str(k), time_s=7.0, source="EXIF", calendar=True, step_s=1.0) for k in range(3)]
    assert [photo.time_s for photo in spread(photos)] == pytest.approx([7.0, 7.0 + 1 / 3, 7.0 + 2 / 3])


def test_whole_seconds_of_an_even_interval_are_evened_out() -> None:
    """Times cut to whole seconds of a camera that fires every 2.37 s come back within 0.1 s; uneven ones stay."""
    true_s = 1000.4 + 2.37 * np.arange(60)
    cut = [
        PhotoTime(name=f"{k:02}", time_s=float(np.floor(t)), source="EXIF", calendar=True, step_s=1.0)
        for k, t in enumerate(true_s)
    ]
    assert [photo.time_s for photo in evened(cut)] == pytest.approx(true_s, abs=0.1)
    assert evened(cut)[0].step_s < 0.2
    gap = cut[:30] + cut[40:]
    assert evened(gap) == gap
