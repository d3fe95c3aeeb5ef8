"""Names of thrusters say where left, front and up are, and so the frame that their places are read in."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.importers.thruster_checks import compare_names, contradictions
from wakewise.robot.vehicles import VehicleDraft

PLACES = np.array([[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0]])
AXES = np.array([[0.6, -0.8, 0.0], [0.6, 0.8, 0.0], [0.6, 0.8, 0.0], [0.6, -0.8, 0.0]])
PLAIN = ["a", "b", "c", "d"]


def listed(names: list[str], places: np.ndarray = PLACES, axes: np.ndarray = AXES, before: str = "") -> str:
    rows = [
        f"- {{name: {n}, position: {p.tolist()}, direction: {a.tolist()}}}\n"
        for n, p, a in zip(names, places, axes, strict=True)
    ]
    return before + "thrusters:\n" + "".join(rows)


def imported(folder: Path, text: str, **options: Any) -> VehicleDraft:
    path = folder / "t.yaml"
    path.write_text(text)
    return import_vehicle(path, **options)


def doubts(draft: VehicleDraft) -> list[str]:
    return [note for note in draft.notes if note.startswith("QUESTIONED")]


@pytest.mark.parametrize(
    "names",
    [
        ["port_bow", "starboard_bow", "port_stern", "starboard_stern"],
        ["front_left", "front_right", "rear_left", "rear_right"],
        ["FLH", "FRH", "BLH", "BRH"],
        ["FL", "FR", "RL", "RR"],
        ["ThrusterFrontLeft", "ThrusterFrontRight", "ThrusterBackLeft", "ThrusterBackRight"],
        ["thruster_frontleft", "thruster_frontright", "thruster_backleft", "thruster_backright"],
        ["L1", "R1", "L2", "R2"],
        ["lf", "rf", "lb", "rb"],
    ],
)
def test_names_of_sides_decide_the_frame(tmp_path: Path, names: list[str]) -> None:
    """Left at y > 0 is FLU, at y < 0 FRD, in words and in short forms; the note names them, and nothing is doubted."""
    for turn, frame in ((1.0, "FLU"), (-1.0, "FRD")):
        draft = imported(tmp_path, listed(names, PLACES * [1, turn, turn], AXES * [1, turn, turn]))
        np.testing.assert_allclose(draft.thrusters[0].p_BT_m, [0.3, -0.2, 0.0])
        assert draft.notes[0].startswith(f"frame: {frame}") and names[0] in draft.notes[0]
        assert not doubts(draft)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_list_of_names_beside_matrices_speaks_as_well(tmp_path: Path, turn: float) -> None:
    """Beside positions and directions, and beside an allocation matrix, whose columns along x and z tell places."""
    frame, signs = "FLU" if turn > 0 else "FRD", np.array([1, turn, turn])
    names = "thruster_names: [front_left, front_right, back_left, back_right]\n"
    places, axes = (PLACES * signs).tolist(), (AXES * signs).tolist()
    text = f"{names}thruster_positions: {places}\nthruster_directions: {axes}"
    assert imported(tmp_path, text).notes[0].startswith(f"frame: {frame}")
    assert imported(tmp_path, text).thrusters[0].name == "front_left"
    ahead, up = np.array([[1.0, 0, 0]] * 2), np.array([[0, 0, 1.0]] * 2)
    wrench = np.hstack([np.vstack([ahead, up]), np.cross(PLACES * signs, np.vstack([ahead, up]))])
    assert imported(tmp_path, f"{names}tam: {wrench.T.tolist()}").notes[0].startswith(f"frame: {frame}")
    rows = "".join(f"  {n}: {row}\n" for n, row in zip(["FL", "FR", "BL", "BR"], wrench.tolist(), strict=True))
    assert imported(tmp_path, f"tam:\n{rows}").notes[0].startswith(f"frame: {frame}")


@pytest.mark.parametrize("frame", ["FLU", "FRD"])
@pytest.mark.parametrize("kind", ["up", "top"])
def test_names_of_up_and_down_decide_where_no_side_is_named(tmp_path: Path, frame: str, kind: str) -> None:
    """A thruster called up pushes up; those called top lie above those called bottom."""
    up = 1.0 if frame == "FLU" else -1.0
    if kind == "up":
        text = listed(["up_1", "up_2", "c", "d"], axes=np.array([[0, 0, up], [0, 0, up], [1, 0, 0], [1, 0, 0]]))
    else:
        text = listed(["top_1", "top_2", "bottom_1", "bottom_2"], PLACES + np.array([[0, 0, up]] * 2 + [[0, 0, 0]] * 2))
    assert imported(tmp_path, text).notes[0].startswith(f"frame: {frame}")


@pytest.mark.parametrize(
    ("before", "frame"),
    [("# body frame is NED\n", "FRD"), ("# positions in FLU, as REP 103 has it\n", "FLU"), ("# ENU to NED\n", "")],
)
def test_a_comment_decides_where_no_key_and_no_name_does(tmp_path: Path, before: str, frame: str) -> None:
    """One comment's frame is taken, and said to be a comment's; two that differ, or none, leave a guess in question."""
    draft = imported(tmp_path, listed(PLAIN, before=before))
    if frame:
        assert (
            draft.notes[0].startswith(f"frame: {frame}")
            and "a comment says so, no key does (t.yaml:1)" in draft.notes[0]
        )
        assert not doubts(draft)
    else:
        assert any("is a guess" in note and "--frame FLU or --frame FRD" in note for note in doubts(draft))


def test_a_guess_is_questioned_and_ends_where_the_user_tells(tmp_path: Path) -> None:
    assert any("is a guess" in note for note in doubts(imported(tmp_path, listed(PLAIN))))
    matrix = "tam: [[1,0],[0,1],[0,0],[0,0],[0,0],[0.5,-0.5]]"
    assert any("is a guess" in note for note in doubts(imported(tmp_path, matrix)))
    assert not doubts(imported(tmp_path, matrix, convention="FRD"))
    assert not doubts(imported(tmp_path, "body_frame: base_flu\n" + listed(PLAIN)))


@pytest.mark.parametrize("way", ["told", "key"])
def test_names_that_contradict_the_frame_are_questioned(tmp_path: Path, way: str) -> None:
    """Whoever says the frame, the names are held against it."""
    names = ["front_left", "front_right", "back_left", "back_right"]
    text = listed(names, before="" if way == "told" else "body_frame: base_frd\n")
    draft = imported(tmp_path, text, **({"convention": "FRD"} if way == "told" else {}))
    assert any("front_left" in note and "other sides" in note for note in doubts(draft))
    turned = imported(tmp_path, listed(names, PLACES * [-1, 1, 1]))
    assert any("bow and stern lie at the other ends" in note for note in doubts(turned))


def test_words_that_only_look_like_sides_say_nothing() -> None:
    """A left-handed propeller, a support or a serial port is on no side; R beside F is the rear."""
    for names in (["left_handed", "right_handed"], ["support_1", "transport_2"], ["F", "R"], ["thruster1", "T2"]):
        assert compare_names(names, PLACES[:2], AXES[:2]).frame == ""
    assert contradictions(["T1", "T2"], PLACES[:2], AXES[:2]) == []


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_buoyancy_above_weight_tells_up(tmp_path: Path, up: float) -> None:
    """Where no key and no name does; a difference below a millimetre tells nothing."""
    draft = imported(tmp_path, listed(PLAIN, before=f"cog: [0, 0, 0]\ncob: [0, 0, {0.02 * up}]\n"))
    assert draft.notes[0].startswith("frame: FLU" if up > 0 else "frame: FRD") and not doubts(draft)
    assert doubts(imported(tmp_path, listed(PLAIN, before="cog: [0, 0, 0]\ncob: [0, 0, 0.0001]\n")))


def test_a_comment_far_from_the_thrusters_says_nothing_of_them(tmp_path: Path) -> None:
    text = listed(PLAIN) + "\n" * 60 + "filter: 3  # accelerations in ENU\n"
    assert any("is a guess" in note for note in doubts(imported(tmp_path, text)))


def test_bow_and_stern_speak_of_one_another(tmp_path: Path) -> None:
    """An origin at the nose puts all thrusters at x < 0; that turns no names round."""
    names = ["bow_left", "bow_right", "stern_left", "stern_right"]
    assert not doubts(imported(tmp_path, listed(names, PLACES - [1.5, 0, 0])))


# A guess by names of links

LINK = """<link name="{name}"/><joint name="{name}_joint" type="fixed"><parent link="base_link"/><child link="{name}"/>
<origin xyz="{xyz}" rpy="{rpy}"/></joint>"""
BASE = '<robot name="r"><link name="base_link"><inertial><mass value="9"/></inertial></link>'


def links(folder: Path, rpys: list[str], extra: str = "", **options: Any) -> VehicleDraft:
    text = ""
    for i, rpy in enumerate(rpys):
        text += LINK.format(name=f"thruster_{i}", xyz=f"{0.1 * (i % 3)} {0.2 * (-1) ** i} 0", rpy=rpy)
    path = folder / "r.urdf"
    path.write_text(f"{BASE}{text}{extra}</robot>")
    return import_vehicle(path, **options)


@pytest.mark.parametrize(
    ("rpys", "match"),
    [
        (["0 1.5707963267948966 0"] * 4, "all 4 push up or down"),
        (["0 0 0"] * 6, r"6 of them make only 2 axes \(rank 2\)"),
    ],
)
def test_a_guess_that_makes_no_vehicle_is_refused(tmp_path: Path, rpys: list[str], match: str) -> None:
    """With the option that tells the axis, by which it is read."""
    with pytest.raises(
        InputError, match=rf"links were taken for thrusters by their names.*{match}.*--thrust-direction"
    ):
        links(tmp_path, rpys)
    assert len(links(tmp_path, rpys, thrust="+y").thrusters) == len(rpys)


def test_vertical_thrusters_that_a_guess_lays_flat_are_refused(tmp_path: Path) -> None:
    extra = LINK.format(name="vertical_thruster_9", xyz="0 0 0.1", rpy="0 0 0")
    with pytest.raises(InputError, match="by the names vertical_thruster_9 push up or down, by their axes they do not"):
        links(tmp_path, ["0 0 0", "0 0 1.57", "0 0 0.785"], extra)
