"""Every key of a list of thrusters is read, or named as not read; formats that are not read are named."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

FRAME = "body_frame: base_frd\n"


def imported(folder: Path, text: str, name: str = "t.yaml") -> VehicleDraft:
    path = folder / name
    path.write_text(text)
    return import_vehicle(path)


def thrusters(first: str, second: str = "", table: bool = False) -> str:
    body = "position: [0.2, 0.1, 0], direction: [1, 0, 0]"
    marks = ("  a:", "  b:") if table else ("-", "-")
    return f"thrusters:\n{marks[0]} {{{body}{first}}}\n{marks[1]} {{{body}{second}}}\n"


def unread(draft: VehicleDraft) -> list[str]:
    return [note for note in draft.notes if "not read: " in note]


@pytest.mark.parametrize("table", [False, True])
def test_flipped_turns_a_thruster_round(tmp_path: Path, table: bool) -> None:
    """As in the wrench matrix that ships beside such a list; a word that is neither true nor false is refused."""
    draft = imported(tmp_path, FRAME + thrusters(", flipped: true", ", flipped: false", table))
    np.testing.assert_array_equal([t.axis_B[0] for t in draft.thrusters], [-1.0, 1.0])
    assert any(n.startswith("flipped: the thrust of") for n in draft.notes) and not unread(draft)
    with pytest.raises(InputError, match="flipped of thruster0 must be true or false"):
        imported(tmp_path, FRAME + thrusters(", flipped: perhaps"))


@pytest.mark.parametrize(
    "key", ["thrust_bounds: [-80, 100]", "force_limits: [-80, 100]", "max_thrust: 100, min_thrust: -80"]
)
def test_limits_of_a_thruster_are_its_own(tmp_path: Path, key: str) -> None:
    """Not the first one's for all; shares of a full thrust are no newtons, and are named as not read."""
    for table in (False, True):
        draft = imported(tmp_path, FRAME + thrusters(f", {key}", table=table))
        assert [(t.max_forward_N, t.max_reverse_N) for t in draft.thrusters] == [(100.0, 80.0), (None, None)]
        assert any("taken as newtons" in n for n in draft.notes) and not unread(draft)
    share = imported(tmp_path, FRAME + thrusters(", thrust_bounds: [-0.8, 1.0]"))
    assert share.thrusters[0].max_forward_N is None
    assert any("thrust_bounds" in n for n in unread(share))
    with pytest.raises(InputError, match="must be on both sides of 0"):
        imported(tmp_path, FRAME + thrusters(", thrust_bounds: [80, 100]"))


@pytest.mark.parametrize("table", [False, True])
def test_keys_of_thrusters_that_are_not_read_are_named_once(tmp_path: Path, table: bool) -> None:
    """With how often they stand there; those that may turn a thrust are questioned."""
    text = thrusters(", node_id: 4, calib: {forward: [1, 2]}, reversed: true", ", node_id: 3, reversed: false", table)
    draft = imported(tmp_path, f"{FRAME}pid: {{x: {{Kp: 1}}}}\nmax_rate: 3\n{text}")
    (doubt, plain) = sorted(unread(draft), reverse=True, key=lambda n: n.startswith("QUESTIONED"))
    assert doubt == "QUESTIONED: not read: reversed (2 times), which may turn the thrust round"
    assert plain.startswith("not read: pid, max_rate, node_id (2 times), ") and plain.count("calib") == 1
    assert "position" not in plain and "body_frame" not in plain


def test_a_file_whose_keys_are_all_read_says_nothing_of_unread_ones(tmp_path: Path) -> None:
    text = "thruster_names: [a, b]\nnum_thrusters: 2\ntam: [[1,0],[0,1],[0,0],[0,0],[0,0],[0.5,-0.5]]\nmass: 3\n"
    assert not unread(imported(tmp_path, FRAME + text))


@pytest.mark.parametrize("key", ["motor_positions", "thruster_params", "propellers"])
def test_lists_that_look_like_thrusters_are_named(tmp_path: Path, key: str) -> None:
    """In a file that holds other things, and in the refusal of one that holds nothing else."""
    listed = f"a: {{{key}: [0.28, 0.25, 0.0, 0.0, -45.0, 0.28, -0.25, 0.0, 0.0, 45.0]}}\n"
    draft = imported(tmp_path, f"{listed}center_of_buoyancy: [0, 0, 0]")
    (doubt,) = unread(draft)
    assert (
        doubt.startswith(f"QUESTIONED: not read: a.{key}, which look like thrusters in a form") and "t.yaml:1" in doubt
    )
    with pytest.raises(InputError, match=rf"neither thrusters nor an allocation matrix.*not read: a.{key}"):
        _ = draft.allocation_matrix
    with pytest.raises(InputError, match=rf"holds no allocation matrix.*a.{key} \(line 1\)"):
        imported(tmp_path, listed)


def test_motors_with_places_are_thrusters_too(tmp_path: Path) -> None:
    assert len(imported(tmp_path, FRAME + thrusters("").replace("thrusters:", "motors:")).thrusters) == 2


@pytest.mark.parametrize(("name", "kind"), [("t.toml", "TOML"), ("t.cfg", "TOML or INI")])
@pytest.mark.parametrize("text", ['g = 3\n[[thrusters]]\nname = "port"\n', "[thrusters]\npos = [1, 2, 3]\n"])
def test_toml_is_refused_by_its_name(tmp_path: Path, name: str, kind: str, text: str) -> None:
    with pytest.raises(InputError, match=rf"is {kind}, which is not read; vehicles are read from URDF, xacro, SDF"):
        imported(tmp_path, text, name)


def test_a_mass_in_kilograms_is_read_and_one_of_zero_is_not_stated(tmp_path: Path) -> None:
    text = FRAME + thrusters("") + "physical: {mass_kg: MASS, displacement_m3: 0.012}\n"
    whole = imported(tmp_path, text.replace("MASS", "12.5"))
    assert (whole.mass_kg, whole.displaced_volume_m3) == (12.5, 0.012) and not unread(whole)
    zero = imported(tmp_path, text.replace("MASS", "0.0"))
    assert zero.mass_kg is None and "mass" in zero.missing
