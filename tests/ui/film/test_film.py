"""Laws of the film: what is written plays, goes on where it stopped, and shows what the record says.

- encode: every kind of file gives the frames back, in number and likeness; odd names and sizes are refused
- hull: fills the stated size, thrusters sit where the vehicle has them, normals are unit vectors
- vantage: everything flown is in the picture
- wash: tracers leave along the jet; a kept answer is the same answer; the water at rest stays at rest
- film: frames made before a stop are used again; the last photograph before each frame is shown
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import polars as pl
import pytest
import trimesh
from PIL import Image as Pictures

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at
from wakewise.core.interfaces import ScalarGrid
from wakewise.operation import load_scenario, write_scenario
from wakewise.operation.flight_log import ExposureRecord, write_exposures
from wakewise.robot.vehicles import load_vehicle, vehicle_names
from wakewise.simulation.water import Water
from wakewise.ui.film import compared_trials, make, write_film, write_rows
from wakewise.ui.film.encode import film_writer
from wakewise.ui.film.external_view import FASTEST_M_S, choose_viewpoint, speed_colours
from wakewise.ui.film.layout import FilmFrame, FilmOverview, FrameComposer, fill_frame
from wakewise.ui.film.make import silt_at
from wakewise.ui.film.wash import STEP_S, TRAIL, RecordedMotion, replay, wash_of
from wakewise.ui.reports.vehicle.hull import corner_normals, hull_of
from wakewise.vision.imaging import PinholeCamera

R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up flight of 1.2 s past the target with two photographs, as a scan would leave it; no result."""
    folder = tmp_path_factory.mktemp("film") / "dp"
    folder.mkdir()
    # A small ball: what it costs to set up the water round a target grows with its triangles.
    ball = folder.parent / "ball.ply"
    trimesh.creation.icosphere(subdivisions=2, radius=0.07).export(ball)
    changes = {"imaging.width": 160, "imaging.height": 120, "imaging.samples": 1, "target.kind": str(ball)}
    scenario = load_scenario("quick", None, changes)
    write_scenario(folder / "scenario.yaml", scenario, {})
    parts = scenario.parts()
    time_s = np.arange(0.0, 1.2, 0.02)
    centre = parts.target.centre_W_m
    place = centre + np.column_stack([-0.6 + 0.1 * time_s, 0.1 * time_s, np.full(len(time_s), -0.25)])
    turns = np.array([Pose.from_matrix(look_at(p, centre), p).q for p in place])
    columns = {"time_s": time_s}
    columns |= {f"true_{a}_m": place[:, i] for i, a in enumerate("xyz")}
    columns |= {f"true_q{a}": turns[:, i] for i, a in enumerate("wxyz")}
    n = len(parts.vehicle.thrusters)
    columns |= {f"thrust_{i + 1}_N": np.full(len(time_s), 3.0 if i == 0 else 0.0) for i in range(n)}
    columns |= {"target_speed_mean_m_s": 0.01 * time_s, "turbidity_per_m": 0.1 * time_s}
    table = pl.DataFrame(columns).with_columns(leg=pl.Series(["orbit 20 deg"] * len(time_s)))
    table.write_parquet(folder / "steps.parquet")
    rows, exposures = [], []
    for k, row in enumerate((10, 40)):
        X_WC = Pose(place[row], turns[row]) @ parts.vehicle.X_BC
        (folder / "images").mkdir(exist_ok=True)
        colour = (255, 0, 0) if k else (0, 0, 255)  # BGR: first red, then blue
        cv2.imwrite(str(folder / "images" / f"{k}.png"), np.full((120, 160, 3), colour, np.uint8))
        pose = {f"true_{a}_m": X_WC.p_m[i] for i, a in enumerate("xyz")}
        pose |= {f"true_q{a}": X_WC.q[i] for i, a in enumerate("wxyz")}
        rows.append({"name": f"{k}.png", "time_s": time_s[row], **pose, "sharpness": 10.0 + k, "turbidity_per_m": 0.1})
        silt = ScalarGrid(origin_W_m=np.array([-0.5, -0.5, 1.0]), spacing_m=0.5, values=np.full((3, 3, 2), 0.01 * k))
        exposures.append(ExposureRecord(time_s=time_s[row], X_WC_true=(X_WC, X_WC), X_WC_est=X_WC, silt=silt))
    pl.DataFrame(rows).write_csv(folder / "images.csv")
    write_exposures(folder / "exposures.npz", exposures, 0.01)
    return folder


def _wave(k: int, w: int = 128, h: int = 96) -> np.ndarray:
    rows, columns = np.mgrid[:h, :w]
    grey = 127 + 100 * np.sin(0.1 * columns + 0.3 * k)
    return np.stack([grey, 255 - grey, 0.5 * rows + 60], axis=2).astype(np.uint8)


@pytest.mark.parametrize("name", ["a.mp4", "a.webm"])
def test_a_film_gives_its_frames_back(name: str, tmp_path: Path) -> None:
    """As many frames as were put in come out, each nearest to the one that was put in (30 dB and more)."""
    frames = [_wave(k) for k in range(12)]
    with film_writer(tmp_path / name, 12.0, (128, 96)) as sink:
        for frame in frames:
            sink.add(frame)
    reader = cv2.VideoCapture(str(tmp_path / name))
    read = []
    while True:
        ok, image = reader.read()
        if not ok:
            break
        read.append(image[..., ::-1])
    reader.release()
    assert len(read) == len(frames)
    assert all(cv2.PSNR(np.ascontiguousarray(a), b) > 30.0 for a, b in zip(read, frames, strict=True))


def test_an_animated_picture_keeps_frames_and_time(tmp_path: Path) -> None:
    """A WebP has every frame, and its durations add up to the film's length within a millisecond."""
    with film_writer(tmp_path / "a.webp", 15.0, (128, 96)) as sink:
        for k in range(7):
            sink.add(_wave(k))
    with Pictures.open(tmp_path / "a.webp") as film:
        assert film.n_frames == 7
        total = 0
        for k in range(7):
            film.seek(k)
            film.load()
            total += film.info["duration"]
    assert abs(total - 7 * 1000.0 / 15.0) <= 1.0


def test_names_and_sizes_that_cannot_be_are_refused(tmp_path: Path) -> None:
    """An unknown ending, a folder and odd sides each give one line; nothing is left behind."""
    with pytest.raises(InputError, match=r"\.gif"), film_writer(tmp_path / "a.gif", 12.0, (128, 96)):
        pass
    (tmp_path / "b.mp4").mkdir()
    with pytest.raises(InputError, match="folder"), film_writer(tmp_path / "b.mp4", 12.0, (128, 96)):
        pass
    with pytest.raises(InputError, match="even"), film_writer(tmp_path / "a.mp4", 12.0, (127, 96)):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["b.mp4"]


@pytest.mark.parametrize("name", vehicle_names())
def test_every_vehicle_of_the_library_can_be_drawn(name: str) -> None:
    """The hull reaches the stated size to a fifth in each direction; normals are unit vectors."""
    vehicle = load_vehicle(name)
    hull = hull_of(vehicle)
    thrusters = vehicle.thruster_positions_B_m
    spread = np.ptp(hull.vertices_B_m, axis=0)
    assert np.all(spread > 0.8 * vehicle.size_m)
    outside = np.maximum(np.ptp(thrusters, axis=0) - vehicle.size_m, 0.0)
    reach = 3.0 * np.sqrt(vehicle.disk_areas_m2.max())
    assert np.all(spread < 1.25 * vehicle.size_m + 2 * outside + reach)
    assert np.allclose(np.linalg.norm(hull.normals, axis=2), 1.0, atol=1e-6)


def test_creases_stay_and_bends_are_smoothed() -> None:
    """A cube's corners keep its faces' normals; a gentle roof's ridge gets the mean of both sides."""
    cube = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    normals = corner_normals(cube, np.array([[0, 2, 1], [0, 1, 3]]))
    assert np.allclose(normals[0], [0, 0, -1])
    assert np.allclose(normals[1], [0, -1, 0])
    roof = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, -0.1], [0.5, -1, -0.1]])
    ridge = corner_normals(roof, np.array([[0, 1, 2], [1, 0, 3]]))
    assert np.allclose(ridge[0, 0], [0, 0, 1], atol=1e-9)


def test_all_that_was_flown_is_in_the_picture() -> None:
    """Every place of the path, with the hull's reach, projects inside."""
    camera = PinholeCamera(400, 250, np.radians(40.0))
    angle = np.linspace(0, 2 * np.pi, 80)
    path = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), np.full(80, 1.0)])
    X_WC = choose_viewpoint(camera, np.array([0.0, 0.0, 1.4]), path, 0.25)
    for shift in 0.25 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]):
        pixels = camera.project(X_WC.inverse().apply(path + shift))
        assert np.all((pixels > 0) & (pixels < [400, 250]))
    assert X_WC.p_m[2] < 1.0


def _held(thrust_N: float, seconds: float) -> RecordedMotion:
    time_s = np.arange(0.0, seconds, 0.02)
    n = len(time_s)
    return RecordedMotion(
        time_s=time_s,
        p_W_m=np.tile([0.0, 0.0, 5.0], (n, 1)),
        q_WB=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        thrusts_N=np.full((n, 1), thrust_N),
    )


@pytest.mark.parametrize("thrust_N", [2.0, -2.0])
def test_tracers_go_with_the_jet(thrust_N: float) -> None:
    """Thrust along +x sends tracers to -x and thrust along -x to +x, most of them well beyond the disk."""
    water = Water(np.array([0.003]), density_kg_m3=1000.0, bed_z_m=10.0, rng=np.random.default_rng(0))
    mounts = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    motion = _held(thrust_N, 2.0)
    tracers = replay(water, motion, mounts, np.array([0.03]), np.array([0.0, 1.6]))
    assert len(tracers[0].age_s) == 0
    x = tracers[1].trail_W_m[:, 0, 0]
    assert tracers[1].trail_W_m.shape[1:] == (TRAIL, 3)
    assert len(x) > 50
    assert np.mean(np.sign(x) == -np.sign(thrust_N)) > 0.95
    assert np.median(np.abs(x)) > 0.15
    assert np.all(tracers[1].age_s <= 1.6 + STEP_S)


def test_water_at_rest_shows_nothing() -> None:
    """Without thrust there is no tracer at all."""
    water = Water(np.array([0.003]), density_kg_m3=1000.0, bed_z_m=10.0, rng=np.random.default_rng(0))
    mounts = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    tracers = replay(water, _held(0.0, 1.0), mounts, np.array([0.03]), np.array([0.8]))
    assert len(tracers[0].age_s) == 0


def test_a_kept_wash_is_the_same_wash(flown: Path, tmp_path: Path) -> None:
    """What is read back equals what was computed, to single precision; other times are computed anew."""
    from wakewise.operation import read_scenario

    scenario, kept = read_scenario(flown / "scenario.yaml"), tmp_path / "wash.npz"
    times = np.array([0.4, 0.8])
    first = wash_of(scenario, flown / "steps.parquet", times, kept)
    written = kept.stat().st_mtime_ns
    again = wash_of(scenario, flown / "steps.parquet", times, kept)
    assert kept.stat().st_mtime_ns == written
    assert len(first[1].age_s) > 0
    for a, b in zip(first, again, strict=True):
        assert np.allclose(a.trail_W_m, b.trail_W_m, atol=1e-5)
        assert np.allclose(a.speed_m_s, b.speed_m_s, atol=1e-6)
    wash_of(scenario, flown / "steps.parquet", np.array([0.4]), kept)
    assert kept.stat().st_mtime_ns != written


def test_a_film_goes_on_where_it_stopped(flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a stop at the second frame only what is missing is drawn; no hidden file stays when the film is whole."""
    drawn: list[int] = []
    real = make._Film.frame

    def stopping(film: make._Film, k: int) -> np.ndarray:
        if k == 2 and not drawn.count(-1):
            drawn.append(-1)
            raise KeyboardInterrupt
        drawn.append(k)
        return real(film, k)

    monkeypatch.setattr(make._Film, "frame", stopping)
    out = tmp_path / "film.mp4"
    with pytest.raises(KeyboardInterrupt):
        write_film(flown, out, seconds=1.0, fps=4.0, view="camera")
    assert not out.exists()
    write_film(flown, out, seconds=1.0, fps=4.0, view="camera")
    assert drawn == [0, 1, -1, 2, 3]
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]
    reader = cv2.VideoCapture(str(out))
    colours = []
    while True:
        ok, image = reader.read()
        if not ok:
            break
        colours.append(image[300, 400])
    # At 0, 0.39, 0.79 and 1.18 s: nothing yet, the red photograph of 0.2 s, the red one, the blue one of 0.8 s.
    assert max(colours[0]) < 60
    assert colours[1][2] > 180
    assert colours[1][0] < 90
    assert colours[3][0] > 180
    assert colours[3][2] < 90


@pytest.mark.slow
def test_the_view_from_outside_shows_the_vehicle_and_its_wash(flown: Path, tmp_path: Path) -> None:
    """Where the hull is, the picture differs from the still scene, and the wash adds light behind it."""
    film = make._Film(flown, 3, 2.0, "both")
    film.prepare(tmp_path / "wash.npz", lambda *_: None)
    outside = film._outside
    assert outside is not None
    pose = Pose(film.motion.p_W_m[-1], film.motion.q_WB[-1])
    plain, depth = outside.picture(pose, None, None)
    lit, _ = outside.picture(pose, None, film._tracers[-1])
    pixel, away = outside.project(pose.p_m[None])
    x, y = pixel[0].astype(int)
    still = outside.still.depth_m[y, x]
    assert depth[y, x] < min(float(still), float(away[0]) + 0.05)
    assert (lit.astype(int) - plain).max() > 40
    assert (lit.astype(int) - plain).min() >= 0
    frame = film.frame(2)
    assert frame.shape == (720, 1280, 3)


def test_silt_is_a_straight_line_between_photographs(flown: Path) -> None:
    """Half way between exposures of 0 and 0.01 kg/m3 there are 0.005; after the last one, its own."""
    from wakewise.operation import read_exposures

    exposures = read_exposures(flown / "exposures.npz")
    middle = 0.5 * (exposures[0].time_s + exposures[1].time_s)
    assert np.allclose(silt_at(exposures, middle).values, 0.005)
    assert np.allclose(silt_at(exposures, 9.0).values, 0.01)
    assert silt_at([], 1.0) is None


def test_silt_far_away_is_mixed_as_that_near_is() -> None:
    """Between two exposures the outer grid, too, is a straight line in time; without one on either there is none."""

    def exposure(time_s: float, outer: bool) -> ExposureRecord:
        far = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=0.2, values=np.full((2, 2, 2), time_s))
        near = ScalarGrid(
            origin_W_m=np.zeros(3), spacing_m=0.05, values=np.zeros((2, 2, 2)), outer=far if outer else None
        )
        return ExposureRecord(time_s=time_s, X_WC_true=(Pose(np.zeros(3)),), X_WC_est=Pose(np.zeros(3)), silt=near)

    mixed = silt_at([exposure(1.0, True), exposure(2.0, True)], 1.25)
    assert mixed is not None and mixed.outer is not None
    assert mixed.outer.values == pytest.approx(np.full((2, 2, 2), 1.25))
    half = silt_at([exposure(1.0, True), exposure(2.0, False)], 1.25)
    assert half is not None and half.outer is None


def test_speed_has_one_colour_and_ends(tmp_path: Path) -> None:
    """Colours stay within 0 and 1, and beyond the fastest nothing changes."""
    colours = speed_colours(np.linspace(0, 2 * FASTEST_M_S, 50))
    assert colours.min() >= 0.0
    assert colours.max() <= 1.0
    assert np.allclose(colours[-1], colours[30])


def test_a_page_without_any_record_still_draws() -> None:
    """No speed, no photographs, no thrusters: a frame is made, and says so."""
    story = FilmOverview(
        title="dp", subtitle="", duration_s=10.0, pace=1.0, legs=(), time_s=np.zeros(0), speed_m_s=np.zeros(0), shots=()
    )
    moment = FilmFrame(
        time_s=1.0, leg="", speed_m_s=None, turbidity_per_m=None, thrusts_N=np.zeros(0), outside=None, photo=None,
        shot=None, since_shot_s=float("inf"),
    )  # fmt: skip
    for view in ("both", "outside", "camera"):
        assert FrameComposer(story, view).frame(moment).shape == (720, 1280, 3)
    assert fill_frame(np.zeros((30, 40, 3), np.uint8), 64, 64).shape == (64, 64, 3)


@pytest.mark.slow
def test_rows_lie_in_the_order_of_the_comparison(flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Methods come as comparison.json has them; the picture has a column per time; a time after the end is refused."""
    folder = tmp_path / "compare"
    folder.mkdir()
    for name in ("b", "a"):
        (folder / name).symlink_to(flown)
    (folder / "comparison.json").write_text(json.dumps({"methods": {"b": {}, "a": {}}}), encoding="utf-8")
    assert list(compared_trials(folder)) == ["b", "a"]
    monkeypatch.setattr("wakewise.ui.film.rows.CELL", (96, 72))
    (folder / "a").unlink()
    write_rows(folder, folder / "rows.png", times_s=(0.0, 0.5))
    picture = cv2.imread(str(folder / "rows.png"))
    assert picture.shape[1] == 2 * 20 + 2 * 96 + 12
    with pytest.raises(InputError, match="flew for"):
        write_rows(folder, folder / "rows.png", times_s=(99.0,))
    with pytest.raises(InputError, match="no finished trials"):
        compared_trials(tmp_path)


def test_bad_requests_are_one_line(flown: Path, tmp_path: Path) -> None:
    """Lengths, rates, views and folders out of range are refused before any work."""
    out = tmp_path / "film.mp4"
    for bad in ({"seconds": 0.0}, {"seconds": float("nan")}, {"fps": 0.5}, {"view": "up"}):
        with pytest.raises(InputError):
            write_film(flown, out, **bad)
    with pytest.raises(InputError, match="trial folder"):
        write_film(tmp_path / "none", out)
    (tmp_path / "images.csv").write_text("name,time_s\na.png,1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"scenario\.yaml"):
        write_film(tmp_path, out)
