"""A soft or a loose target in a flight: its settings, its record, and what is refused beforehand."""

import io
from dataclasses import replace

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid, TargetDeformation
from wakewise.operation.background_renderer import packed, unpacked
from wakewise.operation.flight_log import ExposureRecord, exposure_arrays, read_exposures
from wakewise.operation.photography import fingerprint, moved_m, scenes_of
from wakewise.operation.preflight import check_target
from wakewise.operation.recorder import step_columns
from wakewise.scene.targets import TISSUES

SILT = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((1, 1, 1)))
AT = Pose(np.array([-0.5, 0.0, 1.2]), np.array([0.5, 0.5, 0.5, 0.5]))
STILL = ExposureRecord(time_s=1.0, X_WC_true=(AT, AT, AT), X_WC_est=AT, silt=SILT)
BENT = replace(
    STILL, tips_m=np.array([[0.01, -0.002]]), tip_speeds_m_s=np.array([[0.0, 0.0]]), shift_m=np.array([0.003, 0.0])
)


def scenario(**target):
    return ww.Scenario.preset("quick", world="tank", **{f"target.{name}": value for name, value in target.items()})


@pytest.fixture(scope="module")
def parts():
    """A gorgonian that is photographed small."""
    return scenario(kind="gorgonian").replace(**{"imaging.width": 320, "imaging.height": 240}).parts()


def test_soft_kinds_bend_by_themselves_and_others_are_rigid():
    """By-kind: a gorgonian is of its tissue, a stony coral of none, and `none` makes any rigid."""
    assert scenario().target.tissue is None
    assert scenario().parts().compliance is None
    assert scenario(kind="gorgonian").target.tissue == TISSUES["gorgonian"]
    assert scenario(kind="gorgonian", elasticity="none").target.tissue is None
    assert scenario(kind="brain", elasticity="soft-coral").target.tissue == TISSUES["soft-coral"]


def test_a_tissue_can_be_given_numbers_of_its_own():
    """Each replaces the tissue's own; without a tissue they are refused in a line that says what would be right."""
    own = scenario(kind="gorgonian", stiffness_Pa=5e6, tissue_kg_m3=1100.0, drag=1.0, damping=0.2).target.tissue
    assert (own.stiffness_Pa, own.density_kg_m3, own.drag, own.damping) == (5e6, 1100.0, 1.0, 0.2)
    with pytest.raises(InputError, match="drag is of a target that bends or lies loose"):
        scenario(drag=1.0)
    with pytest.raises(InputError, match="stiffness_Pa is of a target that bends: let elasticity be one of anemone"):
        scenario(stiffness_Pa=5e6)


def test_an_exposure_keeps_how_the_target_stood():
    """Through the file and to the darkroom; a record without it is as it was, and reads as before."""
    file = io.BytesIO()
    np.savez(file, **exposure_arrays([BENT, BENT]))
    file.seek(0)
    back = read_exposures(file)[1]
    sent = unpacked(packed(7, BENT))[1]
    for record in (back, sent):
        for name in ("tips_m", "tip_speeds_m_s", "shift_m"):
            np.testing.assert_array_equal(getattr(record, name), getattr(BENT, name))
        assert fingerprint(record) == fingerprint(BENT)
    assert set(exposure_arrays([BENT])) - set(exposure_arrays([STILL])) == {"tips_m", "tip_speeds_m_s", "shift_m"}
    assert unpacked(packed(1, STILL))[1].tips_m is None


def test_a_photograph_hangs_on_how_the_target_stood():
    """The fingerprint tells tips, their speeds and the shift apart, and all from a target at rest."""
    marks = {
        fingerprint(record)
        for record in (
            STILL,
            BENT,
            replace(BENT, tips_m=BENT.tips_m + 1e-6),
            replace(BENT, tip_speeds_m_s=BENT.tip_speeds_m_s + 1e-6),
            replace(BENT, shift_m=BENT.shift_m + 1e-6),
        )
    }
    assert len(marks) == 5


def test_a_flight_whose_water_is_never_asked_about_has_the_same_columns_in_all_rows():
    """How the target stands is told from the first row on, also where the water is looked at for no other reason."""
    steps = ww.fly(scenario(kind="anemone", points=60).replace(method="dp"), duration_s=0.2, water_every_s=np.inf).steps
    assert steps.height == 10 and steps["sway_m"].is_finite().all()


def test_a_target_that_yields_has_columns_of_its_own():
    """A rigid target's table is as it was; the others keep their order."""
    rigid = step_columns(2)
    assert [name for name in step_columns(2, yields=True) if name in rigid] == rigid
    assert {"sway_m", "sway_x_m", "target_stress_Pa", "shifted_m"} < set(step_columns(2, yields=True))


@pytest.mark.slow
def test_the_scene_of_an_exposure_is_bent_and_shifted(parts):
    """Vertices are where the modes and the shift put them; one scene where the tips hardly move, more where they do."""
    scenes = scenes_of(parts, BENT)
    assert len(scenes) == 1
    n = scenes[0].first_bed_vertex
    expected = parts.target.mesh.vertices_m + moved_m(parts, BENT)
    np.testing.assert_allclose(scenes[0].vertices_F_m[:n] + scenes[0].foot_W_m, expected, atol=1e-6)
    buried = parts.target.mesh.vertices_m[:, 2] > parts.target.bed_z_m
    np.testing.assert_allclose(moved_m(parts, BENT)[buried], np.tile([0.003, 0, 0], (buried.sum(), 1)), atol=1e-12)
    swift = replace(BENT, tip_speeds_m_s=np.array([[0.2, 0.0]]))
    many = scenes_of(parts, swift)
    assert len(many) > 2
    assert len(many) % 2 == 1
    middle = many[len(many) // 2].vertices_F_m[:n] - scenes[0].vertices_F_m[:n]
    half_way = 0.5 * parts.scenario.imaging.exposure_s * 0.2
    assert np.linalg.norm(middle, axis=1).max() == pytest.approx(half_way, rel=0.1)
    assert scenes_of(parts, STILL) == [parts.scene]


def test_what_cannot_be_moved_is_refused_beforehand():
    """Too stiff for the water's step, too soft for its current; as it comes it passes."""
    check_target(scenario(kind="gorgonian").parts())
    with pytest.raises(InputError, match="too stiff"):
        check_target(scenario(kind="gorgonian", stiffness_Pa=1e11).parts())
    fast = scenario(kind="seagrass").replace(**{"tank.current.velocity_m_s": [0.1, 0.0, 0.0]})
    with pytest.raises(InputError, match=r"current of 0\.1 m/s bends seagrass"):
        check_target(fast.parts())
    check_target(scenario(unanchored={"weight_N": 1.0}).parts())
    with pytest.raises(InputError, match=r"target.unanchored: a current of 0\.036 m/s pushes branching"):
        check_target(scenario(unanchored={"weight_N": 0.001}).parts())


@pytest.mark.parametrize("world", ["paper", "lattice"])
def test_worlds_without_a_moving_target_say_so(world):
    """They would show it at rest, so a soft or loose one is refused there."""
    with pytest.raises(InputError, match="holds its target still"):
        _ = scenario(kind="gorgonian").replace(world=world).parts().world
    loose = scenario(unanchored={"weight_N": 1.0}).replace(world=world)
    with pytest.raises(InputError, match="holds its target still"):
        _ = loose.parts().world


def test_the_tank_tells_how_its_target_stands():
    """A gorgonian stands bent from the start by the tank's current, a rigid coral has no posture."""
    soft, rigid = scenario(kind="gorgonian").parts(), scenario().parts()
    _, truth_provider = soft.world.begin()
    posture = truth_provider.posture()
    assert isinstance(posture, TargetDeformation)
    current = np.array(soft.scenario.tank.current.velocity_m_s[:2])
    along = posture.sway_mean_W_m[:2] @ current / np.linalg.norm(current)
    assert 1e-4 < along < 5e-3
    assert rigid.world.begin()[1].posture() is None
