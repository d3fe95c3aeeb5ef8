"""A coloured sphere on a patterned bed, photographed in closed form: posed photos without a renderer."""

from pathlib import Path

import cv2
import numpy as np
import pycolmap

from wakewise.core.geometry import look_at

R_BC = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
# World z points down; the sphere of this radius about the origin stands on the bed.
RADIUS = BED = 0.6
REGION = (np.zeros(3), 1.0)
DISTANCE = 3.0
SIZE, FOCAL, RADIAL = 56, 60.0, 0.05


def sphere_colours(points):
    """Smooth colours of the surface, 0 to 1, shape (..., 3)."""
    return 0.5 + 0.4 * np.sin(4.0 * points + np.array([0.0, 1.0, 2.0]))


def bed_colours(points):
    """Broad patches, paler in all than the sphere, shape (..., 3)."""
    return 0.6 + 0.2 * np.sin(3.0 * points[..., [0, 1, 0]] + 2.0 * points[..., [1, 0, 0]] + np.array([0.5, 2.0, 4.0]))


def look(origin, directions):
    """Colours of unit rays of shape (..., 3) from one point, and distances to the sphere: 0 where only the bed is."""
    along = -directions @ origin
    gap = origin @ origin - along**2
    hit = (gap < RADIUS**2) & (along > 0)
    distance = np.where(hit, along - np.sqrt(np.maximum(RADIUS**2 - gap, 0.0)), 0.0)
    # Rays up into the water end in its even colour, as rays along the bed do far away.
    down = directions[..., 2] > 0.05
    bed = (BED - origin[2]) / np.where(down, directions[..., 2], 1.0)
    floor = np.where(down[..., None], bed_colours(origin + directions * bed[..., None]), 0.6)
    return np.where(hit[..., None], sphere_colours(origin + directions * distance[..., None]), floor), distance


def photograph(folder: Path, rings=((20.0, 10), (45.0, 8), (70.0, 6)), over: int = 4) -> Path:
    """Leave sparse/ and images/ as a reconstruction would: rings (elevation in degrees, photos), 16 rays a pixel."""
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="SIMPLE_RADIAL",
        width=SIZE,
        height=SIZE,
        params=[FOCAL, SIZE / 2 + 0.7, SIZE / 2 - 0.4, RADIAL],
        camera_id=1,
    )
    model.add_camera_with_trivial_rig(camera)
    (folder / "images").mkdir(parents=True)
    (folder / "sparse").mkdir()
    fine = (np.arange(SIZE * over) + 0.5) / over
    flat = camera.cam_from_img(np.stack([a.ravel() for a in np.meshgrid(fine, fine)], axis=1))
    rays_C = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    rays_C /= np.linalg.norm(rays_C, axis=1, keepdims=True)
    number = 0
    for elevation, count in rings:
        for turn in range(count):
            up, side = np.radians(elevation), 2 * np.pi * (turn + 0.3) / count
            centre = DISTANCE * np.array([np.cos(up) * np.cos(side), np.cos(up) * np.sin(side), -np.sin(up)])
            R_WC = look_at(centre, np.zeros(3)) @ R_BC
            pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R_WC.T), -R_WC.T @ centre)
            number += 1
            name = f"{number:03}.png"
            model.add_image_with_trivial_frame(pycolmap.Image(name=name, camera_id=1, image_id=number), pose)
            colours = look(centre, rays_C @ R_WC.T)[0].reshape(SIZE, over, SIZE, over, 3).mean(axis=(1, 3))
            cv2.imwrite(str(folder / "images" / name), np.rint(255 * colours[:, :, ::-1]).astype(np.uint8))
    for point in np.random.default_rng(0).uniform(-1.0, 1.0, (60, 3)):
        model.add_point3D(point, pycolmap.Track(), np.zeros(3, dtype=np.uint8))
    model.write_binary(folder / "sparse")
    return folder
