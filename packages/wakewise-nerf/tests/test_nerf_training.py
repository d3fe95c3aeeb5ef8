"""A field learns a sphere, forgets nothing when stopped, and finds out where space is empty."""

import dataclasses

import numpy as np
import pytest
from analytic_sphere import REGION, look, photograph

torch = pytest.importorskip("torch", reason="needs the extra `nerf` (PyTorch)")

from wakewise.core.errors import StageError
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise_nerf.field.field import OccupancyGrid, RadianceField
from wakewise_nerf.field.held_out_views import draw, psnr_db, split, ssim
from wakewise_nerf.field.posed import read_model, read_posed
from wakewise_nerf.field.rendering import RayTable, origin_in
from wakewise_nerf.field.settings import FieldSettings
from wakewise_nerf.field.training import read_checkpoint, train

BALL = RegionOfInterest(centre_W_m=REGION[0], radius_m=REGION[1])
CPU = torch.device("cpu")
TINY = FieldSettings(
    levels=4,
    table_log2=12,
    coarsest=8,
    finest=48,
    steps=300,
    rays=2048,
    samples_per_step=2**13,
    samples=24,
    occupancy=24,
    warmup_steps=48,
    grid_rate=0.05,
    network_rate=0.02,
    last_rate=0.1,
    checkpoint_every=40,
    threads=1,
)


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = photograph(tmp_path_factory.mktemp("sphere") / "model")
    return read_posed(read_model(folder / "sparse"), folder / "images", BALL, 960)


@pytest.fixture(scope="module")
def trained(photos, tmp_path_factory):
    learn, held_out = split(photos, 8)
    told = []
    training = train(
        RayTable(learn, BALL, CPU),
        TINY,
        CPU,
        tmp_path_factory.mktemp("out") / "checkpoint.pt",
        "key",
        lambda *words: told.append(words),
    )
    return training, held_out, told


def test_every_eighth_photo_is_held_out():
    learn, held_out = split(tuple(range(17)), 8)
    assert held_out == (0, 8, 16)
    assert sorted(learn + held_out) == list(range(17))


def test_unseen_views_of_a_sphere_are_right(trained):
    """24 photos of 56 px, 300 tiny steps: 21 dB and SSIM 0.6 or more, mean of the views that were not learnt from."""
    training, held_out, told = trained
    assert len(held_out) == 3
    scores, plain = [], []
    for photo in held_out:
        image, _, _ = draw(training, origin_in(photo, BALL), photo.directions_W)
        truth = photo.colours / 255.0
        scores.append((psnr_db(image, truth), ssim(image, truth)))
        plain.append(psnr_db(np.broadcast_to(truth.mean(axis=(0, 1)), truth.shape), truth))
    assert (np.mean(scores, axis=0) > [21.0, 0.6]).all(), scores
    # An even image of the right mean colour is far worse.
    assert np.mean(scores, axis=0)[0] > np.mean(plain) + 4.0
    done = [words[0] for words in told]
    assert done == list(range(20, 301, 20)) and {words[1] for words in told} == {300}


def test_depth_of_the_sphere_is_right(trained):
    """Half the light is stopped at its surface, to 6 % of the region: an interval is 8 %, a pixel 5 %."""
    training, held_out, _ = trained
    for photo in held_out:
        _, distance, opacity = draw(training, origin_in(photo, BALL), photo.directions_W)
        _, truth = look(photo.p_WC_m, photo.directions_W.astype(np.float64))
        both = (truth > 0) & (distance > 0)
        assert both.sum() > 0.95 * (truth > 0).sum()
        assert np.median(np.abs(distance - truth)[both]) < 0.06
        assert np.median(opacity[truth > 0]) > 0.95


class Shell:
    """A field in closed form: dense in a ball of radius 0.6 about the origin, `thin` elsewhere."""

    def __init__(self, thin):
        self.thin = thin

    def density_in_cube(self, places):
        inside = torch.linalg.vector_norm(4.0 * places - 2.0, dim=1) < 0.6
        return torch.where(inside, 50.0, self.thin), None


def test_empty_space_is_found_empty():
    """Cells that reach into the ball stay, those away from it go, and come back when the field fills them."""
    occupancy = OccupancyGrid(32, 0.05)
    chance = torch.Generator().manual_seed(0)
    for _ in range(30):
        occupancy.update(Shell(0.0), chance, all_cells=True, apply=True)
    out = torch.nn.functional.normalize(torch.randn(2000, 3, generator=chance), dim=1)
    assert bool(occupancy.holds(out * 0.5).all())
    # A cell is 0.125 wide, so its far corner is 0.22 away.
    assert not bool(occupancy.holds(out * 0.83).any())
    assert not bool(occupancy.holds(out * 40.0).any())
    for _ in range(60):
        occupancy.update(Shell(1.0), chance, all_cells=False, apply=True)
    assert bool(occupancy.holds(out * 0.83).all())


def test_a_thin_field_is_not_emptied():
    """Where all is thinner than the threshold, what is denser than the mean stays."""
    occupancy = OccupancyGrid(16, 0.05)
    assert occupancy.threshold == pytest.approx(0.2)

    class Thin(Shell):
        def density_in_cube(self, places):
            return 1e-3 * super().density_in_cube(places)[0], None

    occupancy.update(Thin(0.1), torch.Generator().manual_seed(0), all_cells=True, apply=True)
    out = torch.nn.functional.normalize(torch.randn(2000, 3, generator=torch.Generator().manual_seed(1)), dim=1)
    assert bool(occupancy.holds(out * 0.3).all())
    assert not bool(occupancy.holds(out * 1.5).any())


def test_stopped_training_goes_on_as_if_it_had_not_been(photos, tmp_path):
    """Interrupted between checkpoints and taken up again: the same parameters, occupancy and losses, bit for bit."""
    table = RayTable(photos, BALL, CPU)
    settings = TINY.model_copy(update={"steps": 100, "checkpoint_every": 40})

    def stop_at_60(done, *_):
        if done == 60:
            raise KeyboardInterrupt

    whole = train(table, settings, CPU, tmp_path / "whole.pt", "key", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        train(table, settings, CPU, tmp_path / "parted.pt", "key", stop_at_60)
    assert read_checkpoint(tmp_path / "parted.pt", CPU)["training"]["step"] == 40
    steps = []
    parted = train(table, settings, CPU, tmp_path / "parted.pt", "key", lambda done, *_: steps.append(done))
    assert steps == [60, 80, 100]
    a, b = whole.state(), parted.state()
    assert a["losses"] == b["losses"] and a["rays"] == b["rays"]
    for part in ("field", "occupancy"):
        assert a[part].keys() == b[part].keys()
        for name in a[part]:
            assert torch.equal(a[part][name], b[part][name]), name


def test_a_checkpoint_of_something_else_is_not_taken(photos, tmp_path):
    """Another key or a damaged file: training begins anew, and the file is whole afterwards."""
    table = RayTable(photos, BALL, CPU)
    settings = TINY.model_copy(update={"steps": 20})
    path = tmp_path / "checkpoint.pt"

    def steps_of(key):
        steps = []
        train(table, settings, CPU, path, key, lambda done, *_: steps.append(done))
        return steps

    assert steps_of("one") == [20]
    assert steps_of("one") == []
    assert steps_of("two") == [20]
    path.write_bytes(path.read_bytes()[:1000])
    assert steps_of("two") == [20]
    path.write_text("nothing")
    assert steps_of("two") == [20]
    assert steps_of("two") == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["checkpoint.pt"]


def test_seed_decides_all(photos, tmp_path):
    """The same seed gives the same field; another gives another."""
    table = RayTable(photos, BALL, CPU)
    made = []
    for seed in (0, 0, 1):
        settings = TINY.model_copy(update={"steps": 20, "random_seed": seed})
        made.append(train(table, settings, CPU, tmp_path / f"{len(made)}.pt", "key", lambda *_: None))
    tables = [m.field.grid.table.detach() for m in made]
    assert torch.equal(tables[0], tables[1])
    assert not torch.equal(tables[0], tables[2])


def test_diverged_training_is_said(photos, tmp_path):
    """A photo table with a number that is none makes the loss none; no field comes of it."""
    table = RayTable(photos, BALL, CPU)
    table.origins[:] = float("nan")
    with pytest.raises(StageError, match="diverged by step 20"):
        train(table, TINY, CPU, tmp_path / "checkpoint.pt", "key", lambda *_: None)
    assert not (tmp_path / "checkpoint.pt").exists()


def test_pixels_without_a_ray_are_left_out(photos):
    """A camera model that cannot be undone at the corner of a photo costs those pixels, not the run."""
    rays = photos[0].directions_W.copy()
    rays[:3] = np.nan
    holed = dataclasses.replace(photos[0], directions_W=rays)
    table = RayTable([holed, photos[1]], BALL, CPU)
    lost = 3 * rays.shape[1]
    assert len(table) == photos[0].colours[..., 0].size + photos[1].colours[..., 0].size - lost
    origins, directions, colours = table.batch(torch.tensor([0, len(table) - 1]))
    assert torch.isfinite(directions).all()
    np.testing.assert_allclose(origins.numpy(), [origin_in(p, BALL) for p in photos[:2]])
    np.testing.assert_allclose(colours[1].numpy(), photos[1].colours[-1, -1] / 255.0, atol=1e-6)


def test_untrained_occupancy_holds_all_that_can_be_reached():
    """Before it is told to decide nothing is empty; cells that no shrunk point can lie in are never asked about."""
    occupancy = OccupancyGrid(16, 0.05)
    field = RadianceField(TINY)
    points = 30.0 * torch.randn(500, 3, generator=torch.Generator().manual_seed(0))
    occupancy.update(field, torch.Generator().manual_seed(0), all_cells=True, apply=False)
    assert bool(occupancy.holds(points).all()) and occupancy.share() == 1.0
    # The ball of radius 2 fills pi / 6 of its cube.
    assert float(occupancy.real.float().mean()) == pytest.approx(np.pi / 6, abs=0.17)
    assert not occupancy.density[~occupancy.real].any()
