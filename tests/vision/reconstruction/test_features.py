"""Features of large photographs fit into the memory of an ordinary computer."""

from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.features import BYTES_PER_PX, ROOM_BYTES, threads_for


def test_large_photos_are_looked_at_by_fewer_threads():
    """Each thread holds the scales of a photo: all of them stay below 6 GB, and there is always one."""
    many = ReconstructionSettings(threads=16)
    assert threads_for(many, 1280, 960) == 16
    large = threads_for(many, 4000, 3000)
    assert large == 2
    assert large * BYTES_PER_PX * 4 * 4000 * 3000 <= ROOM_BYTES < (large + 1) * BYTES_PER_PX * 4 * 4000 * 3000
    assert threads_for(many.model_copy(update={"first_octave": 0}), 4000, 3000) == 8
    assert threads_for(many, 16000, 12000) == 1
    assert threads_for(ReconstructionSettings(), 640, 480) == ReconstructionSettings().threads
