"""What counts as a model."""

import pycolmap

from wakewise.vision.reconstruction.sfm.colmap_mappers import largest_first


def made(photos, points):
    """A model of so many photos; without points, they are only placed."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig = 1, 1, photos
    options.num_points3D = 20
    model = pycolmap.synthesize_dataset(options)
    for number in list(model.points3D)[points:]:
        model.delete_point3D(number)
    return model


def test_placed_photos_without_a_point_are_no_model():
    """What is left is sorted by photos, then by points."""
    few, many, empty = made(3, 20), made(5, 20), made(7, 0)
    assert empty.num_reg_images() == 7 and empty.num_points3D() == 0
    assert largest_first([few, empty, made(3, 10), many])[:2] == [many, few]
    assert largest_first([empty]) == []
