"""Camera calibration from photographs of a ChArUco board: focal length, distortion and what is left unexplained.

S. Garrido-Jurado et al., Automatic generation and detection of highly reliable fiducial markers under occlusion,
Pattern Recognition 47(6), 2014, doi 10.1016/j.patcog.2014.01.005; Z. Zhang, A flexible new technique
for camera calibration, IEEE TPAMI 22(11), 2000, doi 10.1109/34.888718.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.errors import InputError, StageError
from wakewise.vision.image_decoding import grey_of
from wakewise.vision.reconstruction.photos.photo_folder import SUFFIXES, decode

Points = NDArray[np.float32]
Fit = tuple[NDArray[np.float64], NDArray[np.float64], dict[str, NDArray[np.float64]]]
# Markers of 4, 5, 6 and 7 bits, of which a smaller dictionary is the beginning of the larger one.
ARUCO = ("DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL")
APRILTAG = ("DICT_APRILTAG_36h11", "DICT_APRILTAG_36h10", "DICT_APRILTAG_25h9", "DICT_APRILTAG_16h5")
# OpenCV's flags by what the lens model can bend: none; two radial and two tangential coefficients, as COLMAP's OPENCV
# has them; a third radial one; three more that divide. A flat port bends like a lens that divides (T. Treibitz et al.,
# IEEE TPAMI 34(1), 2012, doi 10.1109/TPAMI.2011.105, say where that ends).
COLMAPS = "opencv"
MODELS = {
    "pinhole": cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    COLMAPS: cv2.CALIB_FIX_K3,
    "radial": 0,
    "rational": cv2.CALIB_RATIONAL_MODEL,
}
MIN_CORNERS, MIN_PHOTOS = 8, 3


@dataclass(frozen=True, kw_only=True)
class CalibrationBoard:
    """Squares across and down, and the sides of a square and of a marker in m."""

    columns: int
    rows: int
    square_m: float
    marker_m: float

    def __post_init__(self) -> None:
        if self.columns < 2 or self.rows < 2:
            raise InputError(f"board: {self.columns} x {self.rows} squares, at least 2 x 2 are needed")
        if not 0.0 < self.marker_m < self.square_m:
            raise InputError(
                f"board: markers of {1e3 * self.marker_m:g} mm in squares of {1e3 * self.square_m:g} mm; markers must "
                "be smaller, and both above 0"
            )


@dataclass(frozen=True, kw_only=True)
class CameraCalibration:
    """Result of a calibration.

    residual_px: root mean square distance of board corners in the photographs from where the model puts them;
    residuals_px: the same of every lens model; photo_residual_px: by photograph; left_out: photographs with too few
    corners, and how many. distortion: OpenCV's order (k1, k2, p1, p2, k3, k4, k5, k6). colmap: the camera as COLMAP's
    OPENCV has it, fitted to the same corners whatever `model` the other figures are of; `reconstruct --camera` reads
    it.
    """

    model: str
    residual_px: float
    residual_median_px: float
    residuals_px: dict[str, float]
    focal_x_px: float
    focal_y_px: float
    centre_x_px: float
    centre_y_px: float
    distortion: tuple[float, ...]
    width: int
    height: int
    photos: int
    corners: int
    dictionary: str
    photo_residual_px: dict[str, float]
    left_out: dict[str, int]
    colmap: dict[str, Any]

    def summary(self) -> dict[str, Any]:
        """All figures as plain values for JSON."""
        return {**asdict(self), "distortion": list(self.distortion)}


def calibrate(folder: Path, board: CalibrationBoard, model: str = "radial") -> CameraCalibration:
    """Calibrate the camera that took a folder of photographs of one board.

    `model`: lens model that the figures are of: pinhole, radial or rational. Raises InputError if the folder or the
    model is none, or photographs differ in size; StageError if the board is found in fewer than three photographs.
    """
    if model not in MODELS:
        raise InputError(f"lens model: '{model}', allowed are {', '.join(MODELS)}")
    photos = _read(folder)
    name, detector = board_detector(list(photos.values()), board)
    found: dict[str, tuple[Points, Points]] = {}
    left_out: dict[str, int] = {}
    for photo, grey in photos.items():
        corners, ids, _, _ = detector.detectBoard(grey)
        count = 0 if ids is None else len(ids)
        if count < MIN_CORNERS:
            left_out[photo] = count
            continue
        # Places on the board in m, shape (n, 3), and in the photograph in px, shape (n, 2).
        places = np.asarray(detector.getBoard().getChessboardCorners(), dtype=np.float32)
        found[photo] = places[np.ravel(ids)], np.asarray(corners, dtype=np.float32).reshape(-1, 2)
    if len(found) < MIN_PHOTOS:
        raise StageError(
            f"calibration: the board of {board.columns} x {board.rows} squares is found in {len(found)} of "
            f"{len(photos)} photos, at least {MIN_PHOTOS} must show {MIN_CORNERS} of its corners; "
            + seen(photos, board, name)
        )
    height, width = next(iter(photos.values())).shape
    fits: dict[str, Fit] = {}
    for each, flags in MODELS.items():
        # Each begins where the simpler one ended: left alone, the last one ends in a place worse than the second.
        fits[each] = _fit(found, (width, height), flags, next(reversed(fits.values()), None))
    K, distortion, errors = fits[model]
    every = np.concatenate(list(errors.values()))
    return CameraCalibration(
        model=model,
        residual_px=_rms(every),
        residual_median_px=float(np.median(every)),
        residuals_px={each: _rms(np.concatenate(list(fit[2].values()))) for each, fit in fits.items()},
        focal_x_px=float(K[0, 0]),
        focal_y_px=float(K[1, 1]),
        # OpenCV's pixel centres are at 0, those of everything else here at +0.5.
        centre_x_px=float(K[0, 2]) + 0.5,
        centre_y_px=float(K[1, 2]) + 0.5,
        distortion=tuple(float(value) for value in np.ravel(distortion)[:8]),
        width=width,
        height=height,
        photos=len(found),
        corners=len(every),
        dictionary=name,
        photo_residual_px={photo: _rms(error) for photo, error in errors.items()},
        left_out=left_out,
        colmap=_colmaps(fits[COLMAPS], width, height),
    )


def cameras_txt(found: CameraCalibration) -> str:
    """The camera as COLMAP's cameras.txt."""
    camera = found.colmap
    numbers = " ".join(repr(value) for value in camera["params"])
    return (
        f"# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
        f"1 {camera['model']} {camera['width']} {camera['height']} {numbers}\n"
    )


def _colmaps(fit: Fit, width: int, height: int) -> dict[str, Any]:
    """COLMAP's camera of a fit; its pixel centres are at +0.5, OpenCV's at 0."""
    K, distortion, errors = fit
    params = [K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, *np.ravel(distortion)[:4]]
    return {
        "model": "OPENCV",
        "width": width,
        "height": height,
        "params": [float(value) for value in params],
        "residual_px": _rms(np.concatenate(list(errors.values()))),
    }


def seen(photos: dict[str, NDArray[np.uint8]], board: CalibrationBoard, name: str) -> str:
    """Remark on the markers that are seen of a board that is not found."""
    plain = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)))
    found = [ids for grey in photos.values() if (ids := plain.detectMarkers(grey)[1]) is not None]
    most, last = max(len(ids) for ids in found), max(int(ids.max()) for ids in found)
    has = board.columns * board.rows // 2
    return (
        f"seen are markers of {name}, {most} in a photo and numbered up to {last}, and a board of {board.columns} x "
        f"{board.rows} squares has {has}, numbered up to {has - 1}: does --board give its squares?"
    )


def _read(folder: Path) -> dict[str, NDArray[np.uint8]]:
    """Grey photographs by name, all of one size."""
    inside = folder.iterdir() if folder.is_dir() else ()
    files = sorted(p for p in inside if p.suffix.lower() in SUFFIXES and p.is_file() and not p.name.startswith("."))
    if not files:
        raise InputError(f"{folder}: holds no photos; a folder of photos of a ChArUco board is needed")
    out: dict[str, NDArray[np.uint8]] = {}
    for path in files:
        image = decode(path.read_bytes(), str(path))
        if image is None:
            raise InputError(f"{path}: is no image that can be read")
        grey = grey_of(image)
        first = next(iter(out.values()), grey)
        if grey.shape != first.shape:
            raise InputError(
                f"{path}: is {grey.shape[1]} x {grey.shape[0]} px, the photos before it {first.shape[1]} x "
                f"{first.shape[0]}; one camera has one size"
            )
        out[path.name] = grey
    return out


def board_detector(photos: list[NDArray[np.uint8]], board: CalibrationBoard) -> tuple[str, Any]:
    """The dictionary and the pattern of squares (white or black at the origin) that most corners are found with.

    Where none are found, the dictionary of which most markers are seen.

    Raises StageError if no marker of any is seen.
    """
    some = photos[:: max(1, len(photos) // 3)][:3]
    best: tuple[tuple[int, int], str, Any] = ((-1, -1), "", None)
    for name in (*ARUCO, *APRILTAG):
        if name == APRILTAG[0] and best[0][0] >= MIN_CORNERS:
            break  # which spares the search for them where the board is known
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
        plain = cv2.aruco.ArucoDetector(dictionary)
        markers = [plain.detectMarkers(grey)[1] for grey in some]
        marked = sum(0 if each is None else len(each) for each in markers)
        if marked == 0 or len(dictionary.bytesList) < board.columns * board.rows // 2:
            continue
        for legacy in (False, True):
            made = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, dictionary)
            made.setLegacyPattern(legacy)
            detector = cv2.aruco.CharucoDetector(made)
            ids = [detector.detectBoard(grey)[1] for grey in some]
            count = sum(0 if each is None else len(each) for each in ids)
            if (count, marked) > best[0]:
                best = ((count, marked), name, detector)
    if best[2] is None:
        raise StageError(f"calibration: no marker of {', '.join((*ARUCO, *APRILTAG))} is found in the first photos")
    return best[1], best[2]


def _fit(found: dict[str, tuple[Points, Points]], size: tuple[int, int], flags: int, before: Fit | None) -> Fit:
    """Camera matrix, distortion and each corner's error in px by photograph; starts from the fit before."""
    objects, images = [pair[0] for pair in found.values()], [pair[1] for pair in found.values()]
    K, bent = (None, None) if before is None else (before[0].copy(), before[1].copy())
    guess = 0 if before is None else cv2.CALIB_USE_INTRINSIC_GUESS
    _, K, bent, turns, shifts = cv2.calibrateCamera(objects, images, size, K, bent, flags=flags | guess)
    distortion = np.zeros(8)
    distortion[: min(8, bent.size)] = np.ravel(bent)[:8]
    errors = {}
    for photo, places, seen, turn, shift in zip(found, objects, images, turns, shifts, strict=True):
        wanted = cv2.projectPoints(places, turn, shift, K, distortion)[0].reshape(-1, 2)
        errors[photo] = np.asarray(np.linalg.norm(wanted - seen, axis=1), dtype=np.float64)
    return K, distortion, errors


def _rms(error_px: NDArray[np.float64]) -> float:
    return float(np.sqrt((error_px**2).mean()))
