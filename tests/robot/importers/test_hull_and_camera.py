"""Size by the base link's collision shapes and the camera by a link's name, where nothing else states them."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

INERTIAL = '<inertial><mass value="10"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
AHEAD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def urdf(folder: Path, collisions: str, rest: str = "", base: str = "base_link") -> VehicleDraft:
    path = folder / "r.urdf"
    thruster = link("thruster_1", "0.1 0 0")
    path.write_text(
        f'<robot name="r"><link name="{base}">{INERTIAL}{collisions}</link>'
        + (thruster + rest).replace('"base_link"', f'"{base}"')
        + "</robot>"
    )
    return import_vehicle(path)


def link(name: str, xyz: str, rpy: str = "0 0 0") -> str:
    return (
        f'<link name="{name}"/><joint name="{name}_joint" type="fixed"><parent link="base_link"/>'
        f'<child link="{name}"/><origin xyz="{xyz}" rpy="{rpy}"/></joint>'
    )


def box(size: str, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    return f'<collision><origin xyz="{xyz}" rpy="{rpy}"/><geometry><box size="{size}"/></geometry></collision>'


@pytest.mark.parametrize(
    ("collisions", "size_m"),
    [
        (box("0.5 0.4 0.3"), [0.5, 0.4, 0.3]),
        (box("0.5 0.4 0.3", "0.05 0 -0.1"), [0.6, 0.4, 0.5]),
        (box("0.5 0.4 0.3", rpy="0 0 1.5707963267948966"), [0.4, 0.5, 0.3]),
        (box("0.5 0.4 0.1") + box("0.2 0.2 0.6"), [0.5, 0.4, 0.6]),
        ('<collision><geometry><sphere radius="0.2"/></geometry></collision>', [0.4, 0.4, 0.4]),
        (
            '<collision><origin rpy="0 1.5707963267948966 0"/>'
            '<geometry><cylinder radius="0.1" length="0.8"/></geometry></collision>',
            [0.8, 0.2, 0.2],
        ),
    ],
)
def test_the_size_is_the_box_round_the_base_links_shapes(tmp_path: Path, collisions: str, size_m: list[float]) -> None:
    """It is centred on the origin, as the record's is, and marked as an estimate."""
    draft = urdf(tmp_path, collisions)
    assert draft.size_m == pytest.approx(size_m)
    assert "size" not in draft.missing
    body = next(p for p in draft.provenance if p.group == "body")
    assert body.estimate
    assert "size_m: an estimate by" in body.source


@pytest.mark.parametrize(
    ("collisions", "words"),
    [
        ("", None),
        (box("0.1 0.4 0.3"), "leaves thruster_1 outside, so it is not taken"),
        ('<collision><geometry><mesh filename="hull.dae"/></geometry></collision>', "collision meshes of link"),
        (box("0.5 0.4 0.0"), "has no extent"),
    ],
)
def test_a_shape_that_cannot_be_the_outline_is_not_taken(tmp_path: Path, collisions: str, words: str | None) -> None:
    draft = urdf(tmp_path, collisions)
    assert draft.size_m is None
    notes = [note for note in draft.notes if note.startswith("size: ")]
    assert [words is not None and words in note for note in notes] == ([] if words is None else [True])


@pytest.mark.parametrize(
    ("rest", "axes", "place"),
    [
        (link("camera_link", "0.2 0.1 0.05"), AHEAD, [0.2, -0.1, -0.05]),
        (
            link("camera_optical_frame", "0.2 0.1 0.05", "-1.5707963267948966 0 -1.5707963267948966"),
            AHEAD,
            [0.2, -0.1, -0.05],
        ),
        (link("down_camera_link", "0 0 0") + link("front_camera_link", "0.2 0 0"), AHEAD, [0.2, 0.0, 0.0]),
        (
            link("camera_link", "0.2 0 0", "0 1.5707963267948966 0"),
            np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            [0.2, 0.0, 0.0],
        ),
    ],
)
def test_a_link_called_camera_is_the_mount(tmp_path: Path, rest: str, axes: np.ndarray, place: list[float]) -> None:
    """Its x axis looks ahead and its image is upright; an optical frame has the camera's own axes; it is said so."""
    draft = urdf(tmp_path, "", rest)
    assert draft.X_BC is not None
    assert np.allclose(draft.X_BC.R, axes, atol=1e-9)
    assert draft.X_BC.p_m == pytest.approx(place)
    assert "camera field of view" in draft.missing
    assert any("by the name of link" in note for note in draft.notes)


def test_the_image_is_upright_in_a_body_with_z_down_too(tmp_path: Path) -> None:
    draft = urdf(tmp_path, "", link("camera_link", "0.2 0.1 0.05"), base="base_link_ned")
    assert draft.X_BC is not None
    assert np.allclose(draft.X_BC.R, AHEAD)
    assert draft.X_BC.p_m == pytest.approx([0.2, 0.1, 0.05])


def test_a_sensor_goes_before_a_name_and_other_parts_are_no_camera(tmp_path: Path) -> None:
    sensor = (
        '<gazebo reference="eye"><sensor name="s" type="camera"><horizontal_fov>1.2</horizontal_fov></sensor></gazebo>'
    )
    both = urdf(tmp_path, "", link("camera_link", "0.2 0 0") + link("eye", "0.3 0 0") + sensor)
    assert both.X_BC is not None
    assert both.X_BC.p_m.tolist() == [0.3, 0.0, 0.0]
    assert urdf(tmp_path, "", link("camera_servo_bracket", "0.2 0 0")).X_BC is None


def test_sdf_is_read_alike(tmp_path: Path) -> None:
    path = tmp_path / "m.sdf"
    path.write_text(
        '<sdf version="1.9"><model name="m"><link name="base_link"><inertial><mass>10</mass></inertial>'
        '<collision name="c"><pose>0 0 0.1 0 0 0</pose><geometry><box><size>0.5 0.4 0.3</size></box></geometry>'
        '</collision></link><link name="camera_link"><pose>0.2 0.1 0.05 0 0 0</pose></link></model></sdf>'
    )
    draft = import_vehicle(path)
    assert draft.size_m == pytest.approx([0.5, 0.4, 0.5])
    assert draft.X_BC is not None
    assert draft.X_BC.p_m == pytest.approx([0.2, -0.1, -0.05])
