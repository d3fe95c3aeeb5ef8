"""Views without a reconstruction."""

import numpy as np

from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto


def straight(width, height, focal, centre=(0.0, 0.0, 0.0), R_CW=None):
    """A view that looks along z from a place."""
    return RegisteredPhoto(
        name="00.png",
        width=width,
        height=height,
        focal_px=focal,
        centre_px=np.array([width / 2, height / 2]),
        radial=0.0,
        R_CW=np.eye(3) if R_CW is None else R_CW,
        p_WC_m=np.array(centre),
        near_m=0.1,
        far_m=10.0,
        focus_W_m=np.array([0.0, 0.0, 1.0]),
        seen=np.arange(3),
    )
