"""A thruster counts once, by its propeller, and an arm's mass is not the vehicle's."""

from pathlib import Path

import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

HULL = '<link name="base_link"><inertial><mass value="10"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'


def joint(name: str, parent: str, child: str, kind: str, xyz: str, rpy: str = "0 0 0") -> str:
    return (
        f'<link name="{child}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="1 0 0"/></joint>'
    )


def imported(folder: Path, body: str, base: str = HULL) -> VehicleDraft:
    path = folder / "r.urdf"
    path.write_text(f'<robot name="r">{base}{body}</robot>')
    return import_vehicle(path)


def pair(i: int, hull: str, propeller: str, parent: str) -> str:
    on = f"thruster_{i}" if parent == "hull" else "base_link"
    at = "0.05 0 0" if parent == "hull" else f"{i} 0 0"
    return joint(f"thruster_{i}_joint", "base_link", f"thruster_{i}", hull, f"{i} 0 0") + joint(
        f"propeller_{i}_joint", on, f"propeller_{i}", propeller, at
    )


@pytest.mark.parametrize("parent", ["hull", "base_link"])
@pytest.mark.parametrize(
    ("hull", "propeller"), [("fixed", "fixed"), ("revolute", "continuous"), ("fixed", "continuous")]
)
def test_a_hull_and_its_propeller_are_one_thruster(tmp_path: Path, hull: str, propeller: str, parent: str) -> None:
    draft = imported(tmp_path, pair(1, hull, propeller, parent) + pair(2, hull, propeller, parent))
    assert [t.name for t in draft.thrusters] == ["propeller_1", "propeller_2"]


def test_two_joints_of_one_number_at_one_place_cannot_be_told(tmp_path: Path) -> None:
    body = joint("a", "base_link", "thruster_1", "fixed", "1 0 0") + joint(
        "b", "base_link", "t200_thrust_200_1", "fixed", "1 0 0"
    )
    assert len(imported(tmp_path, body).thrusters) == 2
    with pytest.raises(InputError, match="one thruster at one place, or two"):
        imported(tmp_path, body.replace("t200_thrust_200_1", "thrust_body_1"))


def test_degrees_in_a_urdf_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"r.urdf:1: origin rpy holds the angle 45, which is beyond a turn"):
        imported(tmp_path, joint("t1", "base_link", "thruster_1", "fixed", "1 0 0", "0 0 45"))


ARM = (
    '<link name="arm"><inertial><mass value="2.5"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    '<joint name="shoulder" type="revolute"><parent link="base_link"/><child link="arm"/><axis xyz="0 0 1"/></joint>'
)


def test_an_arms_mass_is_not_the_vehicles(tmp_path: Path) -> None:
    """Where the hull states none, the vehicle's is not known; where it does, what moves is said."""
    thruster = joint("t1", "base_link", "thruster_1", "fixed", "1 0 0")
    bare = imported(tmp_path, ARM + thruster, '<link name="base_link"/>')
    assert bare.mass_kg is None and any("only links of parts or that move" in note for note in bare.notes)
    whole = imported(tmp_path, ARM + thruster)
    assert whole.mass_kg == 12.5 and any("2.5 kg of it move on joints (arm)" in note for note in whole.notes)


def test_a_link_called_arm_base_link_is_not_the_vehicles_base(tmp_path: Path) -> None:
    """Neither its frame nor its mass is taken, fixed or not."""
    arm = ARM.replace('"arm"', '"arm_base_link"').replace("revolute", "fixed")
    thruster = joint("t1", "base_link", "thruster_1", "fixed", "1 0 0")
    for base in ("base_link", "hull"):
        text = (arm.replace("</joint>", '<origin xyz="1 0 0"/></joint>') + thruster).replace('"base_link"', f'"{base}"')
        draft = imported(tmp_path, text, f'<link name="{base}"/>')
        assert draft.mass_kg is None
        assert draft.thrusters[0].p_BT_m.tolist() == [1.0, 0.0, 0.0]


def test_masses_of_parts_in_yaml_are_not_the_vehicles(tmp_path: Path) -> None:
    """The vehicle's own comes first, wherever it stands; two that may be it are refused."""
    path = tmp_path / "m.yaml"
    path.write_text("arm: {mass: 2.5, inertial: {ixx: .1, iyy: .1, izz: .1}}\nrov: {mass: 30, cog: [0, 0, 0.1]}")
    draft = import_vehicle(path)
    assert draft.mass_kg == 30.0 and draft.inertia_kg_m2 is None and any("that of arm" in note for note in draft.notes)
    path.write_text("one: {mass: 2.5}\nother: {mass: 30}")
    with pytest.raises(InputError, match=r"m.yaml:2: one/mass and other/mass state different masses"):
        import_vehicle(path)


def test_two_plugins_of_one_thruster_count_once_and_idle_propellers_are_questioned(tmp_path: Path) -> None:
    """As files for two simulators have it; a joint that is called a thruster and has no plugin is named."""
    name = 'name="thruster" filename="libgz-sim-thruster-system.so"'
    plugin = f"<gazebo><plugin {name}><joint_name>{{}}</joint_name></plugin></gazebo>"
    joints = joint("j1", "base_link", "thruster_1", "continuous", "1 0 0") + joint(
        "j2", "base_link", "thruster_2", "continuous", "0 1 0"
    )
    draft = imported(tmp_path, joints + plugin.format("j1") * 2)
    assert [t.name for t in draft.thrusters] == ["thruster_1"]
    assert any("two plugins drive thruster_1" in note for note in draft.notes)
    assert any("1 further joints are called thrusters: j2" in note for note in draft.notes)


def test_a_cameras_pose_in_degrees_is_read_as_such(tmp_path: Path) -> None:
    path = tmp_path / "a.sdf"
    path.write_text(
        '<sdf><model name="m"><link name="base_link"><inertial><mass>3</mass></inertial><sensor name="c" type="camera">'
        '<pose degrees="true">0 0 0 0 90 0</pose></sensor></link></model></sdf>'
    )
    draft = import_vehicle(path)
    assert draft.X_BC is not None and draft.X_BC.R[2, 2] == pytest.approx(1.0)
    path.write_text(path.read_text().replace(' degrees="true"', ""))
    with pytest.raises(InputError, match=r"a.sdf:1: pose holds the angle 90"):
        import_vehicle(path)


def test_links_without_an_inertial_are_a_kilogram_each_in_sdf(tmp_path: Path) -> None:
    """What the file leaves out is said, and not counted."""
    path = tmp_path / "m.sdf"
    link = '<link name="base_link"><inertial><mass>9</mass></inertial></link>'
    path.write_text(f'<sdf><model name="m">{link}<link name="a"/><link name="b"/></model></sdf>')
    draft = import_vehicle(path)
    assert draft.mass_kg == 9.0
    assert any(n.startswith("QUESTIONED: mass: a, b states no inertial") and "2 kg in all" in n for n in draft.notes)
