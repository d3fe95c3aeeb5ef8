"""Thruster plugins of Gazebo: each known form by its own rule, any other form named and never denied."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

HALF = "1.5707963267948966"


def imported(folder: Path, text: str, name: str = "r.urdf") -> VehicleDraft:
    path = folder / name
    path.write_text(text)
    return import_vehicle(path)


# gz-sim in SDF: a joint's pose turns the axis and moves nothing.

SDF = """<sdf version="1.9"><model name="m">
<link name="base_link"><inertial><mass>9</mass></inertial></link>
<link name="prop"><pose>0.3 0.2 0.1 0 0 LINK</pose></link>
<joint name="prop_joint" type="revolute"><pose>PLACE 0 0 JOINT</pose><parent>base_link</parent><child>prop</child>
  <axis><xyz>1 0 0</xyz></axis></joint>
<plugin filename="PLUGIN" name="n">INSIDE</plugin></model></sdf>"""
FORMS = {
    "gz-sim-thruster-system": "<joint_name>prop_joint</joint_name>",
    "libuuv_thruster_ros_plugin.so": "<linkName>prop</linkName><jointName>prop_joint</jointName>",
}


@pytest.mark.parametrize("plugin", list(FORMS))
@pytest.mark.parametrize("link", [0.0, 0.7])
@pytest.mark.parametrize("joint", [0.0, -0.4])
@pytest.mark.parametrize("place", ["0 0 0", "0.5 -1.5 0.25"])
def test_a_force_acts_at_the_link_whatever_the_joints_pose(
    tmp_path: Path, plugin: str, link: float, joint: float, place: str
) -> None:
    """The axis is turned by link and joint, the place is the link's own."""
    text = SDF.replace("LINK", str(link)).replace("JOINT", str(joint)).replace("PLACE", place)
    (thruster,) = imported(tmp_path, text.replace("PLUGIN", plugin).replace("INSIDE", FORMS[plugin]), "m.sdf").thrusters
    np.testing.assert_allclose(thruster.p_BT_m, [0.3, -0.2, -0.1], atol=1e-12)
    np.testing.assert_allclose(thruster.axis_B, [np.cos(link + joint), -np.sin(link + joint), 0], atol=1e-12)


# Forms beside gz-sim and UUV Simulator

BASE = """<robot name="r"><link name="base_link"><inertial><origin xyz="0 0 0.01"/><mass value="9"/></inertial></link>
<link name="thruster_1"/><joint name="j1" type="continuous"><parent link="base_link"/><child link="thruster_1"/>
<origin xyz="0.3 0.2 0" rpy="0 0 0.5"/><axis xyz="0 1 0"/></joint><gazebo><plugin PLUGIN</plugin></gazebo></robot>"""


@pytest.mark.parametrize(("hand", "sign"), [("ccw", 1.0), ("cw", -1.0)])
def test_hippocampus_thrusters_push_along_their_links_x(tmp_path: Path, hand: str, sign: float) -> None:
    """Whatever the joint's axis; a clockwise propeller turns them round."""
    plugin = (
        f'filename="thruster" name="hippo_gz_plugins::thruster"><link>thruster_1</link><joint>j1</joint>'
        f"<propeller_direction>{hand}</propeller_direction><maximum_rpm>3240</maximum_rpm>"
    )
    draft = imported(tmp_path, BASE.replace("PLUGIN", plugin))
    np.testing.assert_allclose(draft.thrusters[0].axis_B, sign * np.array([np.cos(0.5), -np.sin(0.5), 0]), atol=1e-12)
    assert "HippoCampus" in draft.notes[1]
    assert "not read of the thruster plugins: maximum_rpm" in draft.notes


ORCA = """name="Any" filename="libAny.so"><link_name>r::base_link</link_name>
<thruster name="one"><pos_force>{ahead}</pos_force><neg_force>{astern}</neg_force>
<origin xyz="0.1 0.2 0.3" rpy="0 1.5707963267948966 0"/></thruster>
<thruster><origin xyz="0 0 0" rpy="0 0 0"/></thruster>"""


@pytest.mark.parametrize(("ahead", "astern", "sign"), [(50, 40, 1.0), (-40, -50, -1.0)])
def test_thrusters_in_a_plugin_push_along_their_own_z(tmp_path: Path, ahead: float, astern: float, sign: float) -> None:
    """orca2's form: origins and forces stand in the plugin, its links are turned for their meshes."""
    draft = imported(tmp_path, BASE.replace("PLUGIN", ORCA.format(ahead=ahead, astern=astern)))
    one, two = draft.thrusters
    assert (one.name, two.name) == ("one", "thruster1")
    np.testing.assert_allclose(one.axis_B, [sign, 0, 0], atol=1e-12)
    np.testing.assert_allclose(one.p_BT_m, [0.1, -0.2, -0.3])
    np.testing.assert_allclose(two.axis_B, [0, 0, -1], atol=1e-12)
    assert (one.max_forward_N, one.max_reverse_N) == (abs(ahead), abs(astern))
    assert (two.max_forward_N, two.max_reverse_N) == (50.0, 40.0)
    assert any(n.startswith("QUESTIONED: places of thrusters are from the origin") for n in draft.notes)
    assert not any("no thruster plugin" in n for n in draft.notes)
    with pytest.raises(InputError, match="must be of one sign"):
        imported(tmp_path, BASE.replace("PLUGIN", ORCA.format(ahead=50, astern=-40)))


@pytest.mark.parametrize(
    ("plugin", "named", "inside"),
    [
        ('name="my_thruster" filename="libx.so"><foo>1</foo>', "my_thruster", ""),
        ('name="x" filename="libThrusterThing.so">', "x", ""),
        (
            'name="y" filename="liby.so"><thruster><axis>1 0 0</axis></thruster><thruster/>',
            "y",
            ", with 2 thrusters in it",
        ),
        ('name="propulsion" filename="libz.so"><gain>2</gain>', "propulsion", ""),
    ],
)
def test_a_plugin_of_an_unknown_form_is_named_and_not_denied(
    tmp_path: Path, plugin: str, named: str, inside: str
) -> None:
    """By its name or by thrusters in it; what is then read from names is questioned as a guess."""
    draft = imported(tmp_path, BASE.replace("PLUGIN", plugin))
    assert f"QUESTIONED: not read: plugin {named}, of a form that is not known{inside} (r.urdf:3)" in draft.notes
    assert any(
        n.startswith("QUESTIONED: the file's thruster plugin is not read: links were taken") for n in draft.notes
    )
    assert not any("no thruster plugin" in n for n in draft.notes)


def test_without_any_plugin_that_is_said(tmp_path: Path) -> None:
    notes = imported(tmp_path, BASE.replace("<gazebo><plugin PLUGIN</plugin></gazebo>", "")).notes
    assert any(
        n.startswith("QUESTIONED: no thruster plugin in the file: links were taken for thrusters") for n in notes
    )


@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_a_thruster_that_a_servo_turns_is_questioned(tmp_path: Path, kind: str) -> None:
    """A joint above the propeller's own that moves."""
    plugin = 'name="t" filename="gz-sim-thruster-system"><joint_name>prop_joint</joint_name>'
    servo = (
        f'<link name="prop"/><joint name="prop_joint" type="continuous"><parent link="mount"/><child link="prop"/>'
        f'<axis xyz="1 0 0"/></joint><link name="mount"/><joint name="pan" type="{kind}"><parent link="base_link"/>'
        f'<child link="mount"/></joint><gazebo>'
    )
    draft = imported(tmp_path, BASE.replace("PLUGIN", plugin).replace("<gazebo>", servo))
    questioned = any(n.startswith("QUESTIONED: thrusters on joints that move") for n in draft.notes)
    assert len(draft.thrusters) == 1 and questioned == (kind == "revolute")
