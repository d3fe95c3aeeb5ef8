"""Public vehicle descriptions come in as their authors meant them, and where they contradict themselves it shows."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle, read_matrix
from wakewise.robot.vehicles import VehicleDraft, allocation_rank, draft_yaml, load_draft
from wakewise.robot.vehicles.mixing import compare_matrix

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "vehicle_models"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="needs the public vehicle models of shared/data")

REXROV = DATA / "rexrov" / "uuv_descriptions" / "robots" / "rexrov_default.xacro"
TAM = DATA / "rexrov" / "uuv_control" / "uuv_thruster_manager" / "config" / "rexrov" / "TAM.yaml"
GZ = DATA / "bluerov2_gz" / "models"


def blue(name: str) -> tuple[Path, Path]:
    """Description and controllers of the project blue."""
    folder = DATA / f"blue_{name}"
    return (
        folder / "blue_description" / "description" / name / "config.xacro",
        folder / "blue_demos" / "control_integration" / "config" / f"{name}_controllers.yaml",
    )


def from_blue(name: str, matrix: Path | None = None) -> VehicleDraft:
    return import_vehicle(blue(name)[0], arguments={"use_sim": "true"}, skip_missing=True, matrix=matrix)


def test_rexrov_matrix_from_its_xacro_is_the_shipped_one() -> None:
    """Built from places and axes alone, within 1e-6 of TAM.yaml, and TAM.yaml reads the same as a file of its own."""
    draft = import_vehicle(REXROV, matrix=TAM, skip_missing=True)
    assert draft.shipped_matrix is not None
    np.testing.assert_allclose(draft.allocation_matrix, draft.shipped_matrix, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(import_vehicle(TAM).allocation_matrix, draft.shipped_matrix)
    np.testing.assert_array_equal(read_matrix(TAM)[0], draft.shipped_matrix)
    assert not compare_matrix(draft, draft.shipped_matrix, "TAM").disagreements


def test_rexrov_numbers_are_those_of_its_files() -> None:
    """Mass, buoyancy, added mass and damping, turned from FLU to FRD and to magnitudes."""
    draft = import_vehicle(REXROV, skip_missing=True)
    assert draft.mass_kg == pytest.approx(1862.87, rel=1e-5)
    assert draft.displaced_volume_m3 == 1.83826
    np.testing.assert_allclose(draft.p_BB_m, [0.0, 0.0, -0.3])
    np.testing.assert_allclose(draft.size_m, [2.6, 1.5, 1.6])
    assert draft.inertia_kg_m2 is not None and draft.added_mass is not None and draft.linear_damping is not None
    np.testing.assert_allclose(np.diag(draft.inertia_kg_m2), [525.39, 794.20, 691.23], rtol=1e-4)
    # Under a half turn about x, xy and xz change sign and yz does not; forces couple to moments likewise.
    np.testing.assert_allclose(draft.inertia_kg_m2[[0, 0, 1], [1, 2, 2]], [-1.44, -33.41, 2.6], atol=1e-3)
    np.testing.assert_allclose(draft.added_mass[0], [779.79, 6.8773, 103.32, 8.5426, 165.54, 7.8033])
    assert draft.added_mass[2, 5] == draft.added_mass[5, 2] == pytest.approx(-10.7745 * -1)
    np.testing.assert_allclose(np.diag(draft.linear_damping), [74.82, 69.48, 728.4, 268.8, 309.77, 105])
    assert any("not symmetric" in note and "0.001" in note for note in draft.notes)
    assert {t.time_constant_s for t in draft.thrusters} == {0.05}
    assert "thruster forward limit" in draft.missing


def test_rexrov_as_shared_lacks_includes_and_says_which() -> None:
    """Without leave to skip, the first missing include is refused with its line."""
    with pytest.raises(InputError, match=r"rexrov_base.xacro:30: package uuv_sensor_ros_plugins not found"):
        import_vehicle(REXROV)


@pytest.mark.parametrize(("name", "count", "rank"), [("bluerov2_heavy", 8, 6), ("bluerov2", 6, 5)])
def test_bluerov2_xacro_and_sdf_agree(name: str, count: int, rank: int) -> None:
    """Two projects' files of one vehicle: same thrusters, mass and buoyancy; only the six's drag differs, by 0.2 %."""
    xacro, sdf = from_blue(name), import_vehicle(GZ / name / "model.sdf")
    assert len(sdf.thrusters) == count
    assert allocation_rank(sdf) == rank
    np.testing.assert_allclose(xacro.allocation_matrix, sdf.allocation_matrix, rtol=0, atol=1e-12)
    for field in (
        "mass_kg",
        "inertia_kg_m2",
        "displaced_volume_m3",
        "p_BG_m",
        "p_BB_m",
        "added_mass",
        "linear_damping",
    ):
        np.testing.assert_allclose(getattr(xacro, field), getattr(sdf, field), rtol=1e-12, atol=1e-15)
    assert xacro.quadratic_damping is not None and sdf.quadratic_damping is not None
    ratio = np.diag(xacro.quadratic_damping) / np.diag(sdf.quadratic_damping)
    # 998 against 1000 kg/m3 of water.
    np.testing.assert_allclose(ratio, 1.0 if count == 8 else 1000.0 / 998.0, rtol=2e-4)
    assert xacro.missing == sdf.missing == ("camera mount", "camera field of view", "thruster lag")


def test_heavy_thrusters_push_as_ardusub_expects() -> None:
    """Front thrusters push back, rear ones forward, verticals down, for T > 0; ArduPilot tells the frame."""
    draft = import_vehicle(GZ / "bluerov2_heavy" / "model.sdf")
    np.testing.assert_array_equal(np.sign(np.round(draft.allocation_matrix[0], 2)), [-1, -1, 1, 1, 0, 0, 0, 0])
    np.testing.assert_allclose(draft.allocation_matrix[2, 4:], 1.0)
    np.testing.assert_allclose(draft.thrusters[0].p_BT_m, [0.14, 0.092, 0.0])
    assert any("FLU" in note and "ArduPilot" in note for note in draft.notes)
    assert {t.max_forward_N for t in draft.thrusters} == {50.0}


def test_heavy_controller_matrix_contradicts_its_own_description() -> None:
    """Blue's matrix reverses the roll of all verticals, and its yaw arms are 0.1888 m for 0.164 and 0.171."""
    draft = from_blue("bluerov2_heavy", blue("bluerov2_heavy")[1])
    assert draft.shipped_matrix is not None
    found = compare_matrix(draft, draft.shipped_matrix, "blue").disagreements
    assert {d.thruster for d in found if d.row == "roll" and d.reversed} == {5, 6, 7, 8}
    yaw = [abs(d.geometry) for d in found if d.row == "yaw"]
    np.testing.assert_allclose(yaw, [0.164, 0.164, 0.171, 0.171], atol=5e-4)
    assert not [d for d in found if d.row in ("surge", "sway", "heave")]
    assert any("base_link_fsd" in note for note in draft.notes)


def test_six_controller_matrix_is_the_heavys_cut_short() -> None:
    """Its verticals carry the Heavy's lever arms: roll reversed and doubled, and a pitch that they cannot make."""
    draft = from_blue("bluerov2", blue("bluerov2")[1])
    assert draft.shipped_matrix is not None
    found = {(d.row, d.thruster): d for d in compare_matrix(draft, draft.shipped_matrix, "blue").disagreements}
    assert found["roll", 5].reversed and found["roll", 6].reversed
    assert found["pitch", 5].fault == found["pitch", 6].fault == "not in the geometry"


def test_controllers_alone_give_a_draft_of_matrix_and_numbers() -> None:
    """What a controller file holds is taken; weight that does not fit the mass is told, not used."""
    draft = import_vehicle(blue("bluerov2_heavy")[1])
    assert draft.thrusters == () and draft.shipped_matrix is not None
    assert draft.mass_kg == 13.5
    assert draft.added_mass is not None
    np.testing.assert_allclose(np.diag(draft.added_mass), [5.5, 12.7, 14.6, 0.12, 0.12, 0.12])
    assert any("weight 114.8 does not fit mass 13.5" in note for note in draft.notes)
    assert "displaced volume" in draft.missing and "thruster places and axes" in draft.missing


def test_orca_lists_of_positions_and_directions_have_rank_six() -> None:
    """Row-major 3 x 8 lists; limits of 100 N; its own notes on the frame."""
    draft = import_vehicle(DATA / "vortex_orca" / "orca.yaml")
    assert allocation_rank(draft) == 6
    np.testing.assert_allclose(draft.thrusters[0].p_BT_m, [0.415, 0.169, 0.076])
    np.testing.assert_allclose(draft.thrusters[0].axis_B, np.array([1, -1, 0]) / np.sqrt(2))
    assert {(t.max_forward_N, t.max_reverse_N) for t in draft.thrusters} == {(100.0, 100.0)}
    assert draft.mass_kg == 30.0
    assert draft.missing[:2] == ("size", "displaced volume")
    assert any("not antisymmetric" in note for note in draft.notes)


@pytest.mark.parametrize("source", ["rexrov", "heavy", "orca", "tam"])
def test_what_is_written_is_read_back(source: str, tmp_path: Path) -> None:
    """A draft's YAML holds all of it."""
    draft = {
        "rexrov": lambda: import_vehicle(REXROV, matrix=TAM, skip_missing=True),
        "heavy": lambda: from_blue("bluerov2_heavy"),
        "orca": lambda: import_vehicle(DATA / "vortex_orca" / "orca.yaml"),
        "tam": lambda: import_vehicle(TAM),
    }[source]()
    path = tmp_path / f"{draft.name}.yaml"
    path.write_text(draft_yaml(draft))
    again = load_draft(str(path))
    assert again.missing == draft.missing
    assert again.notes == draft.notes
    np.testing.assert_allclose(again.allocation_matrix, draft.allocation_matrix, rtol=0, atol=1e-12)
    if draft.added_mass is not None:
        np.testing.assert_allclose(again.added_mass, draft.added_mass, rtol=1e-12)
    with pytest.raises(InputError, match="cannot fly"):
        again.vehicle()


def test_frame_and_thrust_direction_can_be_told() -> None:
    """A told frame turns signs, a reversed thrust turns every axis, and both are said."""
    path = GZ / "bluerov2_heavy" / "model.sdf"
    auto = import_vehicle(path)
    frd = import_vehicle(path, convention="FRD")
    np.testing.assert_allclose(frd.thrusters[0].p_BT_m, auto.thrusters[0].p_BT_m * [1, -1, -1])
    assert frd.notes[0].endswith("(told)")
    assert any("BELOW" in note for note in frd.notes)
    back = import_vehicle(path, thrust="reversed")
    np.testing.assert_allclose(back.allocation_matrix, -auto.allocation_matrix)
    along = import_vehicle(path, thrust="-z")
    np.testing.assert_allclose(along.allocation_matrix, auto.allocation_matrix, atol=1e-12)
    assert "told" in along.notes[1]
    refused: list[dict[str, Any]] = [{"convention": "ENU"}, {"thrust": "up"}]
    for wrong in refused:
        with pytest.raises(InputError, match="allowed"):
            import_vehicle(path, **wrong)


def test_a_matrix_of_another_vehicle_is_refused(tmp_path: Path) -> None:
    """Columns must be as many as thrusters."""
    with pytest.raises(InputError, match="has 8 columns, the vehicle has 6 thrusters"):
        import_vehicle(GZ / "bluerov2" / "model.sdf", matrix=TAM)
    assert replace(import_vehicle(TAM), notes=()).shipped_matrix is not None


@pytest.mark.parametrize(
    ("path", "match"),
    [
        (
            "rexrov/uuv_descriptions/urdf/common.urdf.xacro",
            r"common.urdf.xacro:18: only defines macros \(added_mass_sphere",
        ),
        ("rexrov/uuv_control/uuv_thruster_manager/config/rexrov/thruster_manager.yaml", "no allocation matrix"),
        ("bluerov2_gz/models/bluerov2/configs.yaml", r"configs.yaml:\d+: thruster0 has a position but no direction"),
        ("blue_bluerov2/blue_description/config/bluerov2/ardusub.parm", "neither XML nor YAML"),
        ("bluerov2_gz/package.xml", "root element <package> is not read"),
    ],
)
def test_files_that_hold_no_vehicle_say_so_in_one_line(path: str, match: str) -> None:
    """Parts of a project that are not its vehicle."""
    with pytest.raises(InputError, match=match):
        import_vehicle(DATA / path)
