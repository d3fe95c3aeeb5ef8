"""What a file says beside its numbers is not passed over: frames, units, repeated keys, and what no vehicle has."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

LIST = """thrusters:
  - {name: a, position: [0.2, 0.1, 0.3], direction: [1, 0, 0]MORE}
  - {name: b, position: [0.2, -0.1, 0.3], direction: [1, 0, 0]}
"""


def imported(folder: Path, text: str, name: str = "t.yaml") -> VehicleDraft:
    path = folder / name
    path.write_text(text)
    return import_vehicle(path)


def listed(folder: Path, before: str, more: str = "") -> VehicleDraft:
    return imported(folder, before + LIST.replace("MORE", more))


# Frames


@pytest.mark.parametrize(
    ("keys", "down_m"),
    [
        ("world_frame: world_ned\nbase_frame: rov/base_link_flu\n", -0.3),
        ("base_frame: rov/base_link_flu\nworld_frame: world_ned\n", -0.3),
        ("odom_frame: enu\nbody_frame: frd\n", 0.3),
        ("mapFrame: map_enu\nframe: frd\n", 0.3),
        ("world: {frame: ned}\nvehicle: {frame: flu}\n", -0.3),
        ("frame_id: world_enu\nrobot_frame: frd\n", 0.3),
        ("imu_frame: imu_enu\nbody_frame: frd\n", 0.3),
    ],
)
def test_the_frame_of_the_world_is_not_that_of_the_body(tmp_path: Path, keys: str, down_m: float) -> None:
    """A key of the body decides before a bare one, whichever stands first."""
    assert listed(tmp_path, keys).thrusters[0].p_BT_m[2] == pytest.approx(down_m)


def test_a_frame_of_the_world_alone_leaves_the_body_a_guess(tmp_path: Path) -> None:
    notes = listed(tmp_path, "inertial_frame: ned\n").notes
    assert any(note.startswith("QUESTIONED: the frame of") for note in notes)


def test_two_frames_of_the_body_that_differ_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"t.yaml:2: robot_frame is frd, but base_frame is flu"):
        listed(tmp_path, "base_frame: flu\nrobot_frame: frd\n")


# Repeated keys


@pytest.mark.parametrize(("text", "line"), [("mass: 3\nmass: 4\n", 2), ("a: {mass: 3, b: {x: 1, x: 2}}\n", 1)])
def test_a_key_that_stands_twice_is_refused(tmp_path: Path, text: str, line: int) -> None:
    with pytest.raises(InputError, match=rf"t.yaml:{line}: (mass|x) stands twice"):
        listed(tmp_path, text)


# Lengths


@pytest.mark.parametrize(("arm", "believed"), [(0.2, True), (9.9, True), (20.0, False), (200.0, False)])
def test_moments_that_need_an_arm_of_a_ship_are_refused(tmp_path: Path, arm: float, believed: bool) -> None:
    """As of a matrix whose moments are in N cm or N mm."""
    text = f"body_frame: frd\ntam: [[1,1],[0,0],[0,0],[0,0],[0,0],[{-arm},{arm}]]\n"
    if believed:
        assert imported(tmp_path, text).allocation_matrix[5, 1] == arm
    else:
        with pytest.raises(InputError, match=r"column 1 is .* N m per newton.*are these metres\?"):
            imported(tmp_path, text)


SDF = """<sdf version="VERSION"><model name="rov">
  <link name="base_link"><inertial AUTO><mass>10</mass>
    <inertia><ixx>1</ixx><iyy>1</iyy><izz>IZZ</izz></inertia></inertial></link>
  <link name="prop"><pose>0.2 0.1 0 0 0 1.5707963267948966</pose></link>
  <joint name="j" type="revolute"><parent>base_link</parent><child>prop</child><axis><xyz>1 0 0</xyz></axis></joint>
  <plugin filename="gz-sim-thruster-system" name="gz::sim::systems::Thruster">
    <joint_name>j</joint_name><propeller_diameter>DIAMETER</propeller_diameter></plugin>
</model></sdf>"""


def modelled(folder: Path, **values: str) -> VehicleDraft:
    text = SDF
    for key, plain in {"VERSION": "1.9", "AUTO": "", "IZZ": "1", "DIAMETER": "0.1"}.items():
        text = text.replace(key, values.get(key, plain))
    return imported(folder, text, "rov.sdf")


STONEFISH = """<scenario><robot name="rov"><base_link name="base" type="sphere" physics="submerged">
  <dimensions radius="0.2"/></base_link>
  <actuator name="t" type="thruster"><link name="base"/><origin xyz="0 0 0" rpy="0 0 0"/>
    <propeller diameter="DIAMETER" right="true"/></actuator></robot></scenario>"""


@pytest.mark.parametrize(("diameter", "believed"), [("0.1", True), ("76", False), ("0.0001", False), ("-0.1", False)])
def test_a_propeller_of_another_unit_is_refused(tmp_path: Path, diameter: str, believed: bool) -> None:
    """In Gazebo's plugin and in Stonefish's actuator alike."""
    for read in (
        lambda: modelled(tmp_path, DIAMETER=diameter),
        lambda: imported(tmp_path, STONEFISH.replace("DIAMETER", diameter), "rov.scn"),
    ):
        if believed:
            assert read().thrusters[0].disk_area_m2 == pytest.approx(np.pi / 400.0)
        else:
            with pytest.raises(InputError, match=r"propeller diameter .* must be from 0.005 to 2 m; are these metres"):
                read()


# Keys that are not read


def asked(draft: VehicleDraft) -> str:
    return "\n".join(note for note in draft.notes if note.startswith("QUESTIONED: not read"))


@pytest.mark.parametrize(
    "key", ["units: centimetres", "length_unit: furlong", "unit_angle: grad", "given_in: cm", "scale: {of: kgf}"]
)
def test_units_that_are_not_read_are_questioned(tmp_path: Path, key: str) -> None:
    """By their key, or by the value; SI units are those that are taken."""
    assert "names a unit that is not taken" in asked(listed(tmp_path, f"frame: frd\n{key}\n"))
    assert not asked(listed(tmp_path, "frame: frd\nunits: m\nforce_unit: N\nother: here\n"))


@pytest.mark.parametrize(
    "key", ["reversed_thrusters: [0]", "thruster_signs: [1, -1]", "motor_directions: [1, -1]", "inverted: true"]
)
def test_turning_keys_beside_thrusters_or_a_matrix_are_questioned(tmp_path: Path, key: str) -> None:
    matrix = "tam: [[1,1],[0,0],[0,0],[0,0],[0,0],[-0.1,0.1]]\n"
    for draft in (listed(tmp_path, f"frame: frd\n{key}\n"), imported(tmp_path, f"frame: frd\n{key}\n{matrix}")):
        assert "which may turn the thrust round" in asked(draft)
    assert not asked(listed(tmp_path, "frame: frd\ninverted: false\ncamera: {flip: true}\n"))


@pytest.mark.parametrize(
    ("key", "doubt"),
    [
        ("negate: true", "round"),
        ("mirrored: yes", "round"),
        ("backwards: true", "round"),
        ("multiplier: -1", "round"),
        ("multiplier: 1.0", ""),
        ("hand: left", "round"),
        ("prop: ccw", "round"),
        ("cw: true", "round"),
        ("gain: -1.0", "round"),
        ("calib: {k: -2e-3}", "round"),
        ("min_rpm: -3000", ""),
        ("gain: 1.0", ""),
        ("enabled: false", "off"),
        ("active: 0", "off"),
        ("disabled: true", "off"),
        ("enabled: true", ""),
        ("handle: 3", ""),
    ],
)
def test_what_may_turn_or_stop_one_thruster_is_questioned(tmp_path: Path, key: str, doubt: str) -> None:
    said = asked(listed(tmp_path, "frame: frd\n", f", {key}"))
    assert said.endswith(doubt) and bool(said) == bool(doubt)


# SDF


def test_a_mass_that_the_simulator_computes_is_missing(tmp_path: Path) -> None:
    """Neither the default of 1 kg nor a mass beside `auto` is taken."""
    draft = modelled(tmp_path, AUTO='auto="true"')
    assert draft.mass_kg is None and draft.inertia_kg_m2 is None and "mass" in draft.missing
    assert any("inertial auto" in note for note in draft.notes)
    assert modelled(tmp_path, AUTO='auto="false"').mass_kg == 10.0


@pytest.mark.parametrize(
    ("version", "axis"), [("1.3", [1, 0, 0]), ("1.4", [1, 0, 0]), ("1.5", [0, -1, 0]), ("1.10", [0, -1, 0])]
)
def test_axes_before_sdf_1_5_are_in_the_model(tmp_path: Path, version: str, axis: list[float]) -> None:
    """Those of later versions are in the joint, which is turned by 90 degrees to the left here."""
    np.testing.assert_allclose(modelled(tmp_path, VERSION=version).thrusters[0].axis_B, axis, atol=1e-12)


@pytest.mark.parametrize(("izz", "questioned"), [("1.5", False), ("2.0", False), ("2.01", False), ("3", True)])
def test_an_inertia_that_no_body_has_is_questioned(tmp_path: Path, izz: str, questioned: bool) -> None:
    """Rounding of a flat plate's apart."""
    notes = modelled(tmp_path, IZZ=izz).notes
    assert any(note.startswith("QUESTIONED: inertia: the principal moments") for note in notes) == questioned
