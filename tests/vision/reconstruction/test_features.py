"""Features of large photographs fit into the memory of an ordinary computer."""

from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.features import (
    BYTES_DECODED,
    BYTES_PER_PX,
    MAX_DOUBLED_PX,
    ROOM_BYTES,
    threads_for,
)


def test_large_photos_are_looked_at_by_fewer_threads():
    """Each thread holds a photo and the scales of at most 3200 px of it: below 6 GB in all, and always one thread."""
    many = ReconstructionSettings(threads=16)
    assert threads_for(many, 1280, 960) == 16
    large = threads_for(many, 4000, 3000)
    each = BYTES_PER_PX * 4 * MAX_DOUBLED_PX * 0.75 * MAX_DOUBLED_PX + BYTES_DECODED * 4000 * 3000
    assert large == 2
    assert large * each <= ROOM_BYTES < (large + 1) * each
    assert threads_for(many.model_copy(update={"first_octave": 0}), 4000, 3000) == 9
    assert threads_for(many, 60000, 40000) == 1
    assert threads_for(ReconstructionSettings(), 640, 480) == ReconstructionSettings().threads
