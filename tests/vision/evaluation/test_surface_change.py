import numpy as np
import pytest
import trimesh
from analytic_colonies import bed, cone, grown_alone, grown_coral, hemisphere, joined, noisy, smooth_coral, turned
from scipy.spatial.transform import Rotation

from wakewise.core.errors import InputError, StageError
from wakewise.scene.targets import Mesh
from wakewise.vision.evaluation.surface_change import SurfaceChange, compare_models

TURN, SHIFT = (0.3, -0.2, 2.0), (0.2, 0.1, -0.4)


def compare(first: Mesh, second: Mesh, **options: bool) -> SurfaceChange:
    return compare_models(first, second, np.random.default_rng(0), **options)


@pytest.fixture(scope="module")
def before() -> Mesh:
    return grown_coral(0.0, np.random.default_rng(1))


def test_a_coral_grown_by_3_mm_is_told(before: Mesh) -> None:
    """In another frame and with a model's noise the interval holds 3 mm, the volume is right within 25 %."""
    found = compare(before, turned(grown_coral(0.003, np.random.default_rng(2)), TURN, SHIFT))
    assert found.verdict.startswith("grown by"), found.verdict
    assert found.change_low_mm is not None and found.change_high_mm is not None
    assert 0.0 < found.change_low_mm < 3.0 < found.change_high_mm
    exact = volume_cm3(grown_alone(0.003)) - volume_cm3(grown_alone(0.0))
    assert found.figures["growth_volume_cm3"] == pytest.approx(exact, rel=0.25)
    assert found.figures["loss_volume_cm3"] == 0.0


def volume_cm3(part: Mesh) -> float:
    """Volume above z = 0, by the flux through the faces."""
    return 1e6 * float((part.triangles_m[:, :, 2].mean(axis=1) * part.area_vectors_m2[:, 2]).sum())


@pytest.fixture(scope="module")
def unchanged(before: Mesh) -> SurfaceChange:
    """The same coral, modelled again in another frame."""
    return compare(before, turned(grown_coral(0.0, np.random.default_rng(6)), TURN, SHIFT))


@pytest.fixture(scope="module")
def hardly_grown(before: Mesh) -> SurfaceChange:
    """Grown by 1 mm, in another frame."""
    return compare(before, turned(grown_coral(0.001, np.random.default_rng(3)), TURN, SHIFT))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["unchanged", "hardly_grown"])
def test_a_coral_grown_by_1_mm_or_not_at_all_is_not_claimed(name: str, request: pytest.FixtureRequest) -> None:
    """No change can be told, and the smallest one that can is above 1 mm and below 3 mm."""
    found: SurfaceChange = request.getfixturevalue(name)
    assert found.verdict.startswith("no change can be told"), found.verdict
    assert 1.0 < (found.figures["smallest_change_mm"] or 0.0) < 3.0


def egg(grown_m: float = 0.0) -> Mesh:
    """A body without a bed, grown along its normals."""
    ball = trimesh.creation.icosphere(5, 0.05)
    solid = trimesh.Trimesh(np.asarray(ball.vertices) * [1.0, 0.8, 0.7], ball.faces, process=False)
    return Mesh(np.asarray(solid.vertices) + grown_m * np.array(solid.vertex_normals), np.asarray(solid.faces))


@pytest.mark.slow
def test_loss_is_told_as_loss() -> None:
    """A body whose surface lies 3 mm farther in has lost, not grown."""
    found = compare(noisy(egg(), np.random.default_rng(1)), noisy(egg(-0.003), np.random.default_rng(2)))
    assert found.verdict.startswith(("lost by 3", "lost by 2.9")), found.verdict
    assert found.figures["growth_volume_cm3"] == 0.0 < (found.figures["loss_volume_cm3"] or 0.0)


@pytest.mark.slow
def test_loss_of_a_coral_is_told_as_loss(before: Mesh) -> None:
    """Beside its bed, too."""
    found = compare(before, grown_coral(-0.003, np.random.default_rng(4)))
    assert found.verdict.startswith(("lost by 3", "lost by 2.9")), found.verdict
    assert found.figures["growth_volume_cm3"] == 0.0 < (found.figures["loss_volume_cm3"] or 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("grown_m", [-0.006, 0.006])
def test_a_large_change_all_over_does_not_turn_the_colony(grown_m: float, before: Mesh) -> None:
    """Surfaces 6 mm apart fit worse in the true turn than where they cross; the true turn is found all the same."""
    found = compare(before, turned(grown_coral(grown_m, np.random.default_rng(4)), TURN, SHIFT))
    R = found.registration.similarity.R_AB @ Rotation.from_rotvec(TURN).as_matrix()
    assert np.degrees(Rotation.from_matrix(R).magnitude()) < 2.0
    assert found.figures["change_mm"] == pytest.approx(1e3 * grown_m, rel=0.1)


@pytest.mark.slow
def test_growth_at_the_top_alone_is_told_there(before: Mesh) -> None:
    """The rest of the colony holds the registration."""
    height = np.asarray(smooth_coral().vertices)[:, 2]
    top = 0.005 * np.clip((height - 0.042) / 0.005, 0.0, 1.0)
    found = compare(before, turned(grown_coral(top, np.random.default_rng(5)), TURN, SHIFT))
    assert found.where == "at the tips", found.verdict
    assert 3.5 < (found.figures["change_mm"] or 0.0) < 5.5


def test_registration_recovers_a_motion(unchanged: SurfaceChange) -> None:
    """The same coral in another frame comes back within 0.2 degrees and 0.3 mm."""
    found = unchanged.registration.similarity
    R = Rotation.from_rotvec(TURN).as_matrix()
    assert np.degrees(Rotation.from_matrix(found.R_AB @ R).magnitude()) < 0.2
    assert np.linalg.norm(found.R_AB @ np.array(SHIFT) + found.t_A_m) < 3e-4


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1000.0, 1.4])
def test_models_of_different_scale_are_refused_unless_scale_is_to_be_fitted(before: Mesh, scale: float) -> None:
    """A model in millimetres, or 40 % larger, is named in one line; --align-scale finds the ratio within 1 %."""
    other = turned(grown_coral(0.0, np.random.default_rng(7)), TURN, SHIFT)
    other = Mesh(scale * other.vertices_m, other.faces)
    with pytest.raises(InputError, match="different scale"):
        compare(before, other)
    if scale == 1000.0:
        fitted = compare(before, other, align_scale=True)
        assert fitted.registration.similarity.scale == pytest.approx(1.0 / scale, rel=0.01)
        assert fitted.verdict.startswith("no change"), fitted.verdict


@pytest.mark.slow
def test_a_smooth_colony_that_turns_alike_is_compared_too() -> None:
    """A hemisphere tells no turn, which makes no change of it."""
    first, second = (noisy(joined(hemisphere(), bed()), np.random.default_rng(k)) for k in (1, 2))
    assert compare(first, turned(second, TURN, SHIFT)).verdict.startswith("no change")


@pytest.mark.slow
def test_bodies_without_a_bed_are_compared_as_a_whole() -> None:
    """An egg alone is all colony, and no bed is found."""
    found = compare(noisy(egg(), np.random.default_rng(1)), noisy(egg(), np.random.default_rng(2)))
    assert found.bed is None and found.verdict.startswith("no change"), found.verdict


@pytest.mark.slow
def test_two_things_that_have_nothing_in_common_are_no_growth() -> None:
    """A cone against a coral is refused or told as change, never as none."""
    try:
        found = compare(joined(cone(), bed()), grown_coral(0.0, np.random.default_rng(1)))
    except (StageError, InputError):
        return
    assert not found.verdict.startswith("no change"), found.verdict
