"""Each format's own rules: where thrust goes, what signs mean, which frame is meant, and what is not in the file."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle, read_matrix
from wakewise.robot.importers.parsed_vehicle import to_frd, wrench_rows_to_frd
from wakewise.robot.vehicles import VehicleDraft

SIX = nps.arrays(np.float64, (6, 6), elements=st.floats(-10, 10))


def imported(folder: Path, text: str, name: str = "rov.sdf", **options: Any) -> VehicleDraft:
    path = folder / name
    path.write_text(text)
    return import_vehicle(path, **options)


@given(SIX, nps.arrays(np.float64, 6, elements=st.floats(-10, 10)))
def test_turning_the_frame_keeps_energy_and_turns_back(matrix: np.ndarray, twist: np.ndarray) -> None:
    """The number nu' M nu is the same in FLU and FRD, and two turns are none."""
    turned = wrench_rows_to_frd(twist[:, None])[:, 0]
    assert turned @ to_frd(matrix) @ turned == pytest.approx(twist @ matrix @ twist, abs=1e-9)
    np.testing.assert_allclose(to_frd(to_frd(matrix)), matrix)
    np.testing.assert_allclose(to_frd(twist[:3]), twist[:3] * [1, -1, -1])


# Gazebo SDF

SDF = """<sdf version="1.9"><world name="w"><model name="rov">
  <link name="base_link"><inertial><pose>0 0 0.1 0 0 0</pose><mass>10</mass>
    <inertia><ixx>1</ixx><iyy>2</iyy><izz>3</izz><ixy>0.1</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>
    <collision name="c"><pose>0 0 0.2 0 0 0</pose><geometry><box><size>0.5 0.4 0.05</size></box></geometry></collision>
    <sensor name="cam" type="camera"><pose>0.2 0 0 0 0 0</pose>
      <camera><horizontal_fov>1.2</horizontal_fov></camera></sensor>
  </link>
  <link name="left"><pose relative_to="mount">0 0 0 0 0 0</pose></link>
  <link name="right"><pose>0 -0.3 0 0 0 0</pose></link>
  <frame name="mount" attached_to="base_link"><pose degrees="true">0 0.3 0 0 0 90</pose></frame>
  <joint name="left_joint" type="revolute"><parent>base_link</parent><child>left</child>
    <axis><xyz>1 0 0</xyz></axis></joint>
  <joint name="right_joint" type="revolute"><parent>base_link</parent><child>right</child>
    <axis><xyz expressed_in="mount">0 1 0</xyz></axis></joint>
  PLUGINS
</model></world></sdf>"""

THRUSTERS = """<plugin filename="gz-sim-thruster-system" name="gz::sim::systems::Thruster">
    <joint_name>left_joint</joint_name><thrust_coefficient>-0.02</thrust_coefficient>
    <propeller_diameter>0.1</propeller_diameter><max_thrust_cmd>30</max_thrust_cmd><min_thrust_cmd>-20</min_thrust_cmd>
  </plugin><plugin filename="ignition-gazebo-thruster-system" name="ignition::gazebo::systems::Thruster">
    <joint_name>right_joint</joint_name></plugin>"""


def test_gazebo_thrust_goes_along_the_joint_axis_whatever_the_coefficient(tmp_path: Path) -> None:
    """Link poses through frames, axes in other frames, and a coefficient whose sign means the propeller's hand only."""
    draft = imported(tmp_path, SDF.replace("PLUGINS", THRUSTERS))
    left, right = draft.thrusters
    np.testing.assert_allclose(left.p_BT_m, [0, -0.3, 0], atol=1e-12)
    np.testing.assert_allclose(left.axis_B, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(right.axis_B, [-1, 0, 0], atol=1e-12)
    assert (left.max_forward_N, left.max_reverse_N) == (30.0, 20.0)
    assert left.disk_area_m2 == pytest.approx(math.pi * 0.05**2)
    assert right.max_forward_N is None and right.disk_area_m2 is None
    assert "thruster disk (of thruster 2)" in draft.missing
    assert draft.notes[-1].startswith("under-actuated")


def test_mass_inertia_and_camera_are_turned_to_frd(tmp_path: Path) -> None:
    """Places change sign in y and z; so do products of inertia with x; the camera looks forward, upright."""
    draft = imported(tmp_path, SDF.replace("PLUGINS", THRUSTERS))
    np.testing.assert_allclose(draft.p_BG_m, [0, 0, -0.1])
    np.testing.assert_allclose(draft.inertia_kg_m2, [[1, -0.1, 0], [-0.1, 2, 0], [0, 0, 3]])
    assert draft.X_BC is not None and draft.camera_fov_rad == 1.2
    np.testing.assert_allclose(draft.X_BC.R, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(draft.X_BC.p_m, [0.2, 0, 0])
    # Without a plugin for water, collision shapes are shapes for contact.
    assert draft.displaced_volume_m3 is None


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_gazebo_derivatives_become_magnitudes_of_either_sign(tmp_path: Path, sign: float) -> None:
    """Older files state negative derivatives, newer ones may not; cross terms turn; buoyancy is inferred."""
    water = f"""<plugin filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics">
      <link_name>base_link</link_name><xDotU>{5 * sign}</xDotU><yDotV>{6 * sign}</yDotV><yDotR>{0.5 * sign}</yDotR>
      <nDotV>{0.5 * sign}</nDotV><nDotR>{1 * sign}</nDotR><xU>{2 * sign}</xU><xUabsU>{7 * sign}</xUabsU>
      <yVabsV>{8 * sign}</yVabsV><yRabsV>{1 * sign}</yRabsV></plugin>"""
    draft = imported(tmp_path, SDF.replace("PLUGINS", THRUSTERS + water))
    assert draft.added_mass is not None and draft.quadratic_damping is not None and draft.linear_damping is not None
    np.testing.assert_allclose(np.diag(draft.added_mass), [5, 6, 0, 0, 0, 1])
    assert draft.added_mass[1, 5] == draft.added_mass[5, 1] == 0.5
    np.testing.assert_allclose(np.diag(draft.quadratic_damping), [7, 8, 0, 0, 0, 0])
    assert draft.linear_damping[0, 0] == 2
    assert draft.displaced_volume_m3 == pytest.approx(0.01)
    np.testing.assert_allclose(draft.p_BB_m, [0, 0, -0.2])
    assert any("yRabsV" in note for note in draft.notes)
    assert [p.estimate for p in draft.provenance if p.group == "buoyancy"] == [True]


def test_coefficients_of_both_signs_are_not_taken(tmp_path: Path) -> None:
    """A typing error in one sign leaves the whole group missing, with a note."""
    water = """<plugin filename="gz-sim-hydrodynamics-system" name="h"><link_name>base_link</link_name>
      <xUabsU>-7</xUabsU><yVabsV>8</yVabsV></plugin>"""
    draft = imported(tmp_path, SDF.replace("PLUGINS", THRUSTERS + water))
    assert draft.quadratic_damping is None and "quadratic damping" in draft.missing
    assert any("both signs" in note for note in draft.notes)


def test_ardupilot_says_the_frame_and_the_range(tmp_path: Path) -> None:
    """Its turn to airplane axes is evidence; a negative multiplier is told and does not turn the axis."""
    plugin = """<plugin name="ArduPilotPlugin" filename="libArduPilotPlugin.so">
      <modelXYZToAirplaneXForwardZDown>0 0 0 TURN 0 0</modelXYZToAirplaneXForwardZDown>
      <control channel="0"><jointName>right_joint</jointName><cmd_topic>/x/cmd_thrust</cmd_topic>
      <offset>-0.5</offset><multiplier>-80</multiplier></control></plugin>"""
    flu = imported(tmp_path, SDF.replace("PLUGINS", THRUSTERS + plugin.replace("TURN", "3.142")))
    frd = imported(tmp_path, SDF.replace("PLUGINS", THRUSTERS + plugin.replace("TURN", "0")))
    assert "FLU" in flu.notes[0] and "detected" in flu.notes[0]
    assert frd.notes[0].startswith("frame: FRD") and "detected" in frd.notes[0]
    assert (flu.thrusters[1].max_forward_N, flu.thrusters[1].max_reverse_N) == (40.0, 40.0)
    assert any("turns the command round for right" in note for note in flu.notes)


def test_included_models_are_found_beside_the_file(tmp_path: Path) -> None:
    """model://NAME lies in a neighbouring folder; what is not there is told, and a world without a model says why."""
    inner = tmp_path / "models" / "hull"
    inner.mkdir(parents=True)
    (inner / "model.config").write_text("<model/>")
    (inner / "model.sdf").write_text(SDF.replace("PLUGINS", THRUSTERS))
    uris = "".join(f"<include><uri>model://{name}</uri></include>" for name in ("hull", "sun"))
    world = f"<sdf><world name='w'>{uris}</world></sdf>"
    draft = imported(tmp_path / "models", world, "world.sdf")
    assert len(draft.thrusters) == 2
    assert any("sun" in note for note in draft.notes)
    merged = "<sdf><model name='m'><include merge='true'><uri>model://hull</uri></include></model></sdf>"
    assert len(imported(tmp_path / "models", merged, "merged.sdf").thrusters) == 2
    with pytest.raises(InputError, match=r"holds no model \(include left out"):
        imported(tmp_path, world.replace("hull", "gone"), "gone.sdf")


# URDF with UUV Simulator's plugins

URDF = """<robot name="rov"><link name="rov/base_link"><inertial><mass value="20"/><inertia ixx="1" iyy="1" izz="1"/>
  </inertial></link><link name="rov/thruster_1"/><link name="rov/thruster_0"/>
  <joint name="j1" type="continuous"><parent link="rov/base_link"/><child link="rov/thruster_1"/>
    <origin xyz="-0.5 0.1 0" rpy="0 0 1.5707963267948966"/>AXIS</joint>
  <joint name="j0" type="fixed"><parent link="rov/base_link"/><child link="rov/thruster_0"/>
    <origin xyz="0 0 0.2" rpy="0 -1.5707963267948966 0"/></joint>
  <gazebo><plugin name="a" filename="libuuv_thruster_ros_plugin.so"><linkName>rov/thruster_1</linkName>
    <jointName>j1</jointName><thrusterID>1</thrusterID><clampMin>-10</clampMin><clampMax>20</clampMax>
    <dynamics><type>FirstOrder</type><timeConstant>0.2</timeConstant></dynamics>
    <conversion><type>Basic</type><rotorConstant>0.5</rotorConstant></conversion></plugin></gazebo>
  <gazebo><plugin name="b" filename="libuuv_thruster_ros_plugin.so"><linkName>rov/thruster_0</linkName>
    <thrusterID>0</thrusterID><thrust_efficiency>0.5</thrust_efficiency><dynamics><type>ZeroOrder</type></dynamics>
    <conversion><type>LinearInterp</type><inputValues>-1 0 1</inputValues>
    <outputValues>-30 0 40</outputValues></conversion>
  </plugin></gazebo>
  <gazebo><plugin name="u" filename="libuuv_underwater_object_ros_plugin.so"><fluid_density>1000</fluid_density>
    <link name="rov/base_link"><neutrally_buoyant>1</neutrally_buoyant><center_of_buoyancy>0 0 0.1</center_of_buoyancy>
    <box><width>0.4</width><length>0.6</length><height>0.3</height></box><hydrodynamic_model><type>fossen</type>
    <added_mass>1 0 0 0 0.2 0 0 1 0 -0.2 0 0 0 0 1 0 0 0 0 -0.3 0 1 0 0 0.3 0 0 0 1 0 0 0 0 0 0 1</added_mass>
    <linear_damping>-1 -2 -3 -4 -5 -6</linear_damping></hydrodynamic_model></link></plugin></gazebo></robot>"""


def test_uuv_thrusters_push_along_their_joint_axis_or_their_x(tmp_path: Path) -> None:
    """Sorted by their number; limits from the curve at the command's ends or from the table; lags from the rotor."""
    draft = imported(tmp_path, URDF.replace("AXIS", '<axis xyz="0 0 -1"/>'), "rov.urdf")
    first, second = draft.thrusters
    assert (first.name, second.name) == ("thruster_0", "thruster_1")
    np.testing.assert_allclose(first.axis_B, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(second.axis_B, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(second.p_BT_m, [-0.5, -0.1, 0])
    assert (first.max_forward_N, first.max_reverse_N, first.time_constant_s) == (20.0, 15.0, 0.0)
    assert (second.max_forward_N, second.max_reverse_N, second.time_constant_s) == (200.0, 50.0, 0.2)
    assert "joint axis" in draft.notes[1]


def test_uuv_water_is_read_and_its_asymmetry_is_told(tmp_path: Path) -> None:
    """Neutral buoyancy gives the volume; entries that differ are averaged, with the size of the difference."""
    draft = imported(tmp_path, URDF.replace("AXIS", ""), "rov.urdf")
    assert draft.displaced_volume_m3 == pytest.approx(0.02)
    np.testing.assert_allclose(draft.size_m, [0.6, 0.4, 0.3])
    np.testing.assert_allclose(draft.p_BB_m, [0, 0, -0.1])
    assert draft.added_mass is not None and draft.linear_damping is not None
    # (1, 5) = 0.2 and (5, 1) = 0.3 give 0.25, and a half turn about x changes the sign of (1, 5).
    assert draft.added_mass[0, 4] == pytest.approx(-0.25)
    assert any("differs from its mirror image by 0.1 " in note for note in draft.notes)
    np.testing.assert_allclose(np.diag(draft.linear_damping), [1, 2, 3, 4, 5, 6])
    assert draft.quadratic_damping is None


def test_links_are_taken_for_thrusters_by_name_only_without_plugins(tmp_path: Path) -> None:
    """And the guess is said."""
    bare = URDF[: URDF.index("<gazebo>")].replace("AXIS", '<axis xyz="1 0 0"/>') + "</robot>"
    draft = imported(tmp_path, bare, "rov.urdf")
    assert [t.name for t in draft.thrusters] == ["thruster_1"]
    assert draft.notes[1].startswith("thrust direction: inferred from names")


def test_freefloating_thrusters_are_columns_of_a_matrix(tmp_path: Path) -> None:
    """Each map is a wrench; without places the draft holds a matrix only."""
    plugin = """<gazebo><plugin name="c" filename="libfreefloating_gazebo_control.so">
      <thruster><map>1 0 0 0 0 0.2</map></thruster><thruster>SECOND</thruster></plugin></gazebo></robot>"""
    hull = URDF[: URDF.index('<link name="rov/thruster_1')]
    draft = imported(tmp_path, hull + plugin.replace("SECOND", "<map>0 0 1 0 0.1 0</map>"), "rov.urdf")
    assert draft.thrusters == ()
    np.testing.assert_array_equal(draft.allocation_matrix.T, [[1, 0, 0, 0, 0, -0.2], [0, 0, -1, 0, -0.1, 0]])
    turning = imported(tmp_path, hull + plugin.replace("SECOND", "<name>x</name>"), "rov.urdf")
    assert turning.shipped_matrix is None and any("no fixed axis" in note for note in turning.notes)


# Stonefish

STONEFISH = """<scenario><environment><ned latitude="0" longitude="0"/></environment>
<robot name="sub" fixed="false"><base_link name="Hull" type="model" physics="submerged">
  <mass value="30"/><inertia xyz="1 2 3"/><cg xyz="0 0 0.02" rpy="0 0 0"/></base_link>
  THRUSTER
  <actuator name="Down" type="thruster"><link name="Hull"/><origin xyz="0.1 0.2 0" rpy="0 ${-pi/2} 0"/>
    <specs max_setpoint="40" inverted_setpoint="true" normalized_setpoint="true"/>
    <propeller diameter="0.2" right="false"/>
    <rotor_dynamics type="first_order"><time_constant value="0.1"/></rotor_dynamics>
    <thrust_model type="quadratic"><thrust_coeff value="0.05"/></thrust_model></actuator>
  <sensor name="cam" type="camera"><link name="Hull"/><specs horizontal_fov="90"/>
    <origin xyz="0.4 0 0" rpy="1.5707963267948966 0 1.5707963267948966"/></sensor>
  <world_transform xyz="$(arg where)" rpy="0 0 0"/></robot></scenario>"""
FORWARD = """<actuator name="Fwd" type="thruster"><link name="Hull"/><origin xyz="-0.5 0.3 0.1" rpy="0 0 0"/>
    <specs max_setpoint="50" inverted_setpoint="false" normalized_setpoint="false"/>
    <propeller diameter="0.1" right="RIGHT"/><rotor_dynamics type="zero_order"/>
    <thrust_model type="linear_interpolation"><input value="-40 0 60"/><output value="-30 0 60"/></thrust_model>
  </actuator>"""


def test_stonefish_is_frd_and_hands_turn_the_thrust(tmp_path: Path) -> None:
    """A left-handed propeller turns +x round, an inverted setpoint turns it back; tables give limits."""
    draft = imported(tmp_path, STONEFISH.replace("THRUSTER", FORWARD.replace("RIGHT", "true")), "sub.scn")
    forward, down = draft.thrusters
    np.testing.assert_allclose(forward.p_BT_m, [-0.5, 0.3, 0.1])
    np.testing.assert_allclose(forward.axis_B, [1, 0, 0], atol=1e-12)
    assert (forward.max_forward_N, forward.max_reverse_N, forward.time_constant_s) == (50.0, 30.0, 0.0)
    np.testing.assert_allclose(down.axis_B, [0, 0, 1], atol=1e-12)
    assert (down.max_forward_N, down.max_reverse_N, down.time_constant_s) == (80.0, 80.0, 0.1)
    left = imported(tmp_path, STONEFISH.replace("THRUSTER", FORWARD.replace("RIGHT", "false")), "sub.scn").thrusters[0]
    np.testing.assert_allclose(left.axis_B, [-1, 0, 0], atol=1e-12)
    # A left-handed rotor pushes the other way as hard: its table is of its own turning.
    assert (left.max_forward_N, left.max_reverse_N) == (50.0, 30.0)
    assert draft.notes[0].startswith("frame: FRD")


def test_stonefish_leaves_to_its_meshes_what_they_hold(tmp_path: Path) -> None:
    """Mass, centre and camera are stated; water and volume are not."""
    draft = imported(tmp_path, STONEFISH.replace("THRUSTER", ""), "sub.scn")
    assert draft.mass_kg == 30.0
    np.testing.assert_allclose(draft.p_BG_m, [0, 0, 0.02])
    np.testing.assert_allclose(draft.inertia_kg_m2, np.diag([1.0, 2.0, 3.0]))
    assert draft.X_BC is not None and draft.camera_fov_rad == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(draft.X_BC.R, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    assert {"added mass", "displaced volume", "linear damping"} <= set(draft.missing)


def test_stonefish_includes_take_arguments(tmp_path: Path) -> None:
    """A scenario includes its robot by an argument; without a value it says which one to give."""
    (tmp_path / "sub.scn").write_text(STONEFISH.replace("THRUSTER", ""))
    scenario = '<scenario><include file="$(param robot)"/></scenario>'
    draft = imported(tmp_path, scenario, "main.scn", arguments={"robot": "sub.scn"})
    assert draft.name == "sub"
    with pytest.raises(InputError, match=r"holds no robot .*--arg robot:=VALUE"):
        imported(tmp_path, scenario, "main.scn")
    with pytest.raises(InputError, match="climbs out"):
        imported(tmp_path, scenario, "main.scn", arguments={"robot": "/etc/passwd"})


# YAML


@pytest.mark.parametrize(
    "text",
    [
        "tam: [[1,0],[0,1],[0,0],[0,0],[0,0],[0.5,-0.5]]",
        "a: {allocation_matrix: [1,0, 0,1, 0,0, 0,0, 0,0, 0.5,-0.5]}",
        "a: {b: {TAM: {fx: [1,0], fy: [0,1], fz: [0,0], mx: [0,0], my: [0,0], mz: [0.5,-0.5]}}}",
        "thruster_allocation_matrix: [[1,0,0,0,0,0.5],[0,1,0,0,0,-0.5]]",
    ],
)
def test_matrices_are_found_under_their_many_names(tmp_path: Path, text: str) -> None:
    """Rows, flat lists, named rows and transposes give one matrix, turned from FLU since nothing says otherwise."""
    draft = imported(tmp_path, text, "m.yaml")
    wanted = np.array([[1, 0], [0, -1], [0, 0], [0, 0], [0, 0], [-0.5, 0.5]])
    np.testing.assert_array_equal(draft.allocation_matrix, wanted)
    assert "inferred" in draft.notes[0]
    told = imported(tmp_path, "body_frame: base_link_ned\n" + text, "m.yaml")
    np.testing.assert_array_equal(told.allocation_matrix[1], [0, 1])
    assert "detected" in told.notes[0]


def test_a_matrix_without_a_frame_is_read_as_the_geometry_agrees(tmp_path: Path) -> None:
    """Of the two frames the one with more agreeing entries is taken, and said."""
    path = tmp_path / "m.yaml"
    path.write_text("tam: [[1,0],[0,1],[0,0],[0,0],[0,0],[0.5,-0.5]]")
    stated = np.array([[1, 0], [0, 1], [0, 0], [0, 0], [0, 0], [0.5, -0.5]])
    for geometry, frame in ((stated, "FRD"), (wrench_rows_to_frd(stated), "FLU")):
        matrix, notes = read_matrix(path, "auto", geometry)
        np.testing.assert_array_equal(matrix, geometry)
        assert f"matrix read as six rows, forces first, {frame}: 12 of 12 entries agree so" in notes[-1]


@pytest.mark.parametrize(
    "text",
    [
        "thruster_positions: [[1,0,0],[0,2,0],[0,0,3],[1,1,1]]\n"
        "thruster_directions: [[1,0,0],[0,1,0],[0,0,-1],[0,2,0]]",
        "thruster_position: [1,0,0,1, 0,2,0,1, 0,0,3,1]\nthruster_force_direction: [1,0,0,0, 0,1,0,1, 0,0,-1,0]",
        "thrusters:\n"
        "- {name: thruster0, position: [1,0,0], direction: [1,0,0]}\n"
        "- {name: thruster1, position: {x: 0, y: 2, z: 0}, rpy: [0, 0, 1.5707963267948966]}\n"
        "- {name: thruster2, x: 0, y: 0, z: 3, axis: [0,0,-1]}\n"
        "- {name: thruster3, xyz: [1,1,1], orientation: {roll: 0, pitch: 0, yaw: 1.5707963267948966}}\n",
    ],
)
def test_positions_and_directions_are_read_in_columns_rows_and_tables(tmp_path: Path, text: str) -> None:
    """Three layouts of one vehicle."""
    draft = imported(tmp_path, text, "t.yaml")
    np.testing.assert_allclose([t.p_BT_m for t in draft.thrusters], [[1, 0, 0], [0, 2, 0], [0, 0, 3], [1, 1, 1]])
    axes = [[1, 0, 0], [0, 1, 0], [0, 0, -1], [0, 1, 0]]
    np.testing.assert_allclose([t.axis_B for t in draft.thrusters], axes, atol=1e-12)
    assert [t.name for t in draft.thrusters] == [f"thruster{i}" for i in range(4)]


def test_a_rigid_mass_matrix_gives_mass_centre_and_inertia(tmp_path: Path) -> None:
    """The coupling blocks m S(r) move the inertia to the centre of gravity by Steiner's rule."""
    mass, r = 4.0, np.array([0.1, 0.2, -0.3])
    S = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
    inertia = np.diag([1.0, 2.0, 3.0])
    matrix = np.block([[mass * np.eye(3), -mass * S], [mass * S, inertia - mass * S @ S]])
    text = f"physical: {{frame_id: base_frd, mass_matrix: {matrix.ravel().tolist()}}}"
    draft = imported(tmp_path, text, "m.yaml")
    assert draft.mass_kg == mass
    np.testing.assert_allclose(draft.inertia_kg_m2, inertia, atol=1e-12)
