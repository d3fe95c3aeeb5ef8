"""Stonefish: which way and how hard each model of thrust pushes, and what a robot of parts weighs."""

import math
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

MODELS = {
    "quadratic": '<thrust_coeff value="0.02"/>',
    "deadband": '<thrust_coeff forward="0.02" reverse="0.01"/><deadband lower="-100" upper="200"/>',
    "linear_interpolation": '<input value="-60 0 60"/><output value="-30 0 60"/>',
    "fluid_dynamics": '<thrust_coeff forward="0.4" reverse="0.3"/><torque_coeff value="0.05"/>',
}
TOP, DIAMETER, DENSITY = 50.0, 0.1, 1000.0


def thrust(model: str, rotor: float, right: bool) -> float:
    """Force along +x in newton of a rotor at `rotor` rad/s in water at rest, written from the models' own equations."""
    square = rotor * abs(rotor)
    if model == "fluid_dynamics":
        ahead = (rotor > 0.0) == right
        per = DENSITY * DIAMETER**4 * (rotor / (2.0 * math.pi)) ** 2
        return 0.4 * per if ahead else -0.3 * per
    force = {
        "quadratic": 0.02 * square,
        "deadband": 0.01 * (square + 100.0) if square < -100.0 else 0.02 * (square - 200.0) if square > 200.0 else 0.0,
        "linear_interpolation": float(np.interp(rotor, [-60.0, 0.0, 60.0], [-30.0, 0.0, 60.0])),
    }[model]
    return force if right else -force


HULL = '<base_link name="Hull" type="model"><mass value="9"/></base_link>'
WATER = '<environment><ocean><water density="1000"/></ocean></environment>'


def robot(folder: Path, actuators: str, links: str = HULL, water: str = WATER) -> VehicleDraft:
    path = folder / "r.scn"
    path.write_text(f'<scenario>{water}<robot name="r">{links}{actuators}</robot></scenario>')
    return import_vehicle(path)


def actuator(model: str, right: bool, inverted: bool, rotor: str = "zero_order") -> str:
    return (
        '<actuator name="t" type="thruster"><link name="Hull"/><origin xyz="0 0.2 0" rpy="0 0 0"/>'
        f'<specs max_setpoint="{TOP}" inverted_setpoint="{str(inverted).lower()}" normalized_setpoint="true"/>'
        f'<propeller diameter="{DIAMETER}" right="{str(right).lower()}"/><rotor_dynamics type="{rotor}"/>'
        f'<thrust_model type="{model}">{MODELS[model]}</thrust_model></actuator>'
    )


@pytest.mark.parametrize("model", list(MODELS))
@pytest.mark.parametrize("right", [True, False])
@pytest.mark.parametrize("inverted", [True, False])
def test_direction_and_limits_are_those_of_each_model(tmp_path: Path, model: str, right: bool, inverted: bool) -> None:
    """For both hands and both senses of the setpoint, the axis is where a positive setpoint pushes."""
    t = robot(tmp_path, actuator(model, right, inverted)).thrusters[0]
    ahead, astern = (thrust(model, -s if inverted else s, right) for s in (TOP, -TOP))
    np.testing.assert_allclose(t.axis_B, [math.copysign(1.0, ahead), 0, 0])
    np.testing.assert_allclose([t.max_forward_N, t.max_reverse_N], [abs(ahead), abs(astern)], rtol=1e-12)


@pytest.mark.parametrize("coefficient", [0.02, -0.02])
def test_a_negative_coefficient_turns_the_thrust(tmp_path: Path, coefficient: float) -> None:
    text = actuator("quadratic", True, False).replace("0.02", str(coefficient))
    t = robot(tmp_path, text).thrusters[0]
    np.testing.assert_allclose(t.axis_B, [math.copysign(1.0, coefficient), 0, 0])
    assert (t.max_forward_N, t.max_reverse_N) == (50.0, 50.0)


def test_limits_are_open_where_the_file_does_not_tell_them(tmp_path: Path) -> None:
    """Without the water's density, or with a rotor that does not settle at its setpoint."""
    assert robot(tmp_path, actuator("fluid_dynamics", True, False), water="").thrusters[0].max_forward_N is None
    assert robot(tmp_path, actuator("quadratic", True, False, "yoerger")).thrusters[0].max_forward_N is None


@pytest.mark.parametrize("kind", ["simple_thruster", "push"])
@pytest.mark.parametrize("inverted", [True, False])
def test_a_simple_force_is_not_turned_by_its_propeller(tmp_path: Path, kind: str, inverted: bool) -> None:
    """SimpleThruster draws the hand; Push has none. Only `inverted` turns them."""
    prefix = "" if kind == "push" else "thrust_"
    t = robot(
        tmp_path,
        f'<actuator name="t" type="{kind}"><link name="Hull"/><propeller right="false"/>'
        f'<specs inverted="{str(inverted).lower()}" lower_{prefix}limit="-20" upper_{prefix}limit="30"/></actuator>',
    ).thrusters[0]
    np.testing.assert_allclose(t.axis_B, [-1.0 if inverted else 1.0, 0, 0])
    assert (t.max_forward_N, t.max_reverse_N) == (30.0, 20.0)


def test_what_is_not_read_of_actuators_is_named(tmp_path: Path) -> None:
    """Rudders and aerial propellers are named once, and a word that Stonefish ignores is questioned."""
    others = "".join(f'<actuator name="a" type="{kind}"><link name="Hull"/></actuator>' for kind in ("rudder", "servo"))
    ignored = actuator("quadratic", True, False).replace("inverted_setpoint", "inverted").replace('="false"', '="true"')
    notes = robot(tmp_path, ignored + others).notes
    assert any("not read: actuators that are no thrusters (1 of type rudder, 1 of type servo)" in n for n in notes)
    assert any(n.startswith("QUESTIONED: thruster t: not read: inverted") for n in notes)


def test_a_thruster_of_before_the_thrust_models_keeps_its_rule(tmp_path: Path) -> None:
    """Its specs say inverted; what they hold beside is named as not read."""
    old = '<specs thrust_coeff="0.45" torque_coeff="0.01" max_rpm="3000" inverted="INVERTED"/>'
    for right in (True, False):
        for inverted in (True, False):
            specs = old.replace("INVERTED", str(inverted).lower())
            text = (
                f'<actuator name="t" type="thruster"><link name="Hull"/>{specs}'
                f'<propeller diameter="0.08" right="{str(right).lower()}"/></actuator>'
            )
            draft = robot(tmp_path, text)
            np.testing.assert_allclose(draft.thrusters[0].axis_B, [1.0 if right != inverted else -1.0, 0, 0])
            assert any(n.startswith("not read: thrust_coeff and max_rpm of 1 thrusters") for n in draft.notes)


PART = (
    '<external_part name="{name}" type="{kind}"><origin xyz="0 0 0.1" rpy="0 0 0"/>{mass}'
    '<compound_transform xyz="{at}" rpy="0 0 0"/></external_part>'
)


def compound(*parts: str) -> str:
    # A compound's own mass is nobody's: Stonefish adds up the parts.
    return f'<base_link name="Hull" type="compound"><mass value="77"/>{"".join(parts)}</base_link>'


def test_a_compound_weighs_what_its_parts_do_where_they_are(tmp_path: Path) -> None:
    """Sum of masses, centres at each part's transform, inertia by Steiner's rule, and further links by their joints."""
    inertia = '<inertia xyz="0.1 0.2 0.3"/>'
    hull = PART.format(name="a", kind="box", at="0 0 0", mass='<mass value="10"/>' + inertia)
    pod = PART.format(name="b", kind="box", at="0.5 0 0", mass='<mass value="5"/>' + inertia)
    claw = (
        '<link name="claw" type="box"><origin xyz="0 0 0" rpy="0 0 0"/><mass value="0.3"/></link>'
        '<joint name="j" type="fixed"><parent name="Hull"/><child name="claw"/><origin xyz="0.25 0 0"/></joint>'
    )
    draft = robot(tmp_path, "", compound(hull, pod) + claw)
    assert draft.mass_kg == pytest.approx(15.3) and "mass" not in draft.missing
    np.testing.assert_allclose(draft.p_BG_m, [(2.5 + 0.075) / 15.3, 0, 0.1 * 15 / 15.3])
    alone = robot(tmp_path, "", compound(hull, pod))
    # Two parts half a metre apart: reduced mass 10/3 kg times (0.5 m)^2 about y and z.
    np.testing.assert_allclose(alone.inertia_kg_m2, np.diag([0.2, 0.4 + 5 / 6, 0.6 + 5 / 6]), atol=1e-12)


@pytest.mark.parametrize("where", ["part", "link", "empty"])
def test_a_mass_that_is_not_all_stated_is_missing(tmp_path: Path, where: str) -> None:
    """What Stonefish computes from a mesh is never left out of a sum that is called the vehicle's mass."""
    stated = PART.format(name="a", kind="box", at="0 0 0", mass='<mass value="10"/>')
    open_part = PART.format(name="dome", kind="model", at="0 0 0", mass="")
    links = {
        "part": compound(stated, open_part),
        "link": compound(stated) + '<link name="dome" type="model"/>',
        "empty": compound() + '<link name="claw" type="box"><mass value="0.3"/></link>',
    }[where]
    draft = robot(tmp_path, actuator("quadratic", True, False), links)
    assert draft.mass_kg is None and {"mass", "centre of gravity"} <= set(draft.missing)
    assert any(n.startswith("mass: ") and "states none" in n and "not the vehicle's" in n for n in draft.notes)
    with pytest.raises(InputError, match=r"neither thrusters nor mass .*states none"):
        robot(tmp_path, "", links)


def test_a_centre_that_only_a_mesh_tells_is_missing(tmp_path: Path) -> None:
    """A mass with no cg of a mesh leaves the centre of gravity open; that of a box is where the box is."""
    assert robot(tmp_path, "").p_BG_m is None
    at = '<base_link name="Hull" type="box"><origin xyz="0.1 0 0.2"/><mass value="9"/></base_link>'
    np.testing.assert_allclose(robot(tmp_path, "", at).p_BG_m, [0.1, 0, 0.2])


@pytest.mark.parametrize("name", ["$(param robot_name)", "$(arg ns)/"])
def test_a_name_that_nothing_fills_in_is_not_shown(tmp_path: Path, name: str) -> None:
    path = tmp_path / "sub.scn"
    text = f'<robot name="{name}"><base_link name="Hull"/>{actuator("quadratic", True, False)}</robot>'
    path.write_text(text.replace('name="t"', f'name="{name}_t"'))
    draft = import_vehicle(path)
    assert (draft.name, draft.thrusters[0].name) == ("sub", "t")
    assert any("has no value in the file" in n for n in draft.notes)


def test_a_scenario_of_macros_that_nobody_calls_says_so(tmp_path: Path) -> None:
    path = tmp_path / "sub.scn.xacro"
    path.write_text(
        '<scenario xmlns:xacro="http://ros.org/wiki/xacro"><xacro:macro name="sub" params="name">'
        f'<robot name="${{name}}">{HULL}</robot></xacro:macro></scenario>'
    )
    with pytest.raises(InputError, match=r"holds no robot \(it defines the macros sub and calls none"):
        import_vehicle(path)


@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_a_thruster_that_a_servo_turns_is_questioned(tmp_path: Path, kind: str) -> None:
    """Its direction is that of the joint at zero."""
    links = (
        f'{HULL}<link name="duct" type="box"><mass value="0.1"/></link><joint name="j" type="{kind}">'
        '<parent name="Hull"/><child name="duct"/><origin xyz="-0.5 0 0" rpy="0 0 0"/></joint>'
    )
    draft = robot(tmp_path, actuator("quadratic", True, False).replace('link name="Hull"', 'link name="duct"'), links)
    np.testing.assert_allclose(draft.thrusters[0].p_BT_m, [-0.5, 0.2, 0])
    questioned = any(n.startswith("QUESTIONED: thrusters on joints that move") for n in draft.notes)
    assert questioned == (kind == "revolute")
