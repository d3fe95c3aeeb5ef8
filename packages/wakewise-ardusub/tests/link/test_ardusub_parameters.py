"""Parameters of an autopilot, over a link that loses things, and of files."""

from __future__ import annotations

import contextlib
import os
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fake_autopilot import FakeAutopilot
from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.link.parameters import (
    GROUND_NAMES,
    WANTED,
    first_of,
    read_all_parameters,
    read_parameter_file,
    read_parameters,
    set_parameter,
)

SOME = {"SYSID_THISMAV": 1.0, "FRAME_CONFIG": 2.0, "SCR_ENABLE": 1.0, "MOT_3_DIRECTION": -1.0}
DATA = Path(os.environ.get("WAKEWISE_DATA", "")) / "ardusub"
REAL = pytest.mark.skipif(not DATA.is_dir(), reason="WAKEWISE_DATA does not lead to ardusub/")


def test_by_name_those_that_there_are() -> None:
    """What the firmware does not know is left out after being asked for again, what it knows comes as it is."""
    assert read_parameters(FakeAutopilot(SOME)) == SOME


@pytest.mark.parametrize("kind", ["in", "out"])
def test_what_was_lost_is_asked_for_again(kind: str) -> None:
    """A third of the requests or of the answers lost: all come, by name and by list."""
    many = {f"P_{i}": float(i) for i in range(40)}
    luck = random.Random(5)
    lossy = FakeAutopilot(many, lose=lambda where, count: where == kind and luck.random() < 0.33)
    assert read_parameters(lossy, many) == many
    lossy = FakeAutopilot(many, lose=lambda where, count: where == "out" and count % 3 == 0)
    assert read_all_parameters(lossy) == dict(sorted(many.items()))


def test_an_autopilot_that_says_nothing_is_said() -> None:
    """Nobody there, or another vehicle's id: one line, no hang."""
    send_blocked = FakeAutopilot(SOME, lose=lambda where, count: True)
    with pytest.raises(EnvironmentFailure, match="says no parameter"):
        read_parameters(send_blocked)
    with pytest.raises(EnvironmentFailure, match="says no parameter"):
        read_all_parameters(send_blocked)
    other = FakeAutopilot({"A": 1.0, "B": 2.0, "C": 3.0}, lose=lambda where, count: where == "out" and count > 1)
    with pytest.raises(EnvironmentFailure, match="2 of 3 parameters never came"):
        read_all_parameters(other)


def test_answers_of_others_are_not_the_autopilots() -> None:
    """A camera's PARAM_VALUE, or another vehicle's, is none of this autopilot's."""
    link = FakeAutopilot(SOME)
    value = {"param_id": b"SCR_ENABLE", "param_value": 0.0, "param_type": 9, "param_count": 1, "param_index": 0}
    link.say("param_value", component=100, **value)
    link.say("param_value", system=9, **value)
    assert read_parameters(link)["SCR_ENABLE"] == 1.0


def test_setting_is_believed_only_when_read_back() -> None:
    """Also after a loss; one that is not taken or not known is an error, and so is a name that cannot be."""
    link = FakeAutopilot(dict(SOME), lose=lambda where, count: where == "in" and count == 1)
    set_parameter(link, "SCR_ENABLE", 0.1)
    assert link.parameters["SCR_ENABLE"] == pytest.approx(0.1)
    with pytest.raises(EnvironmentFailure, match="MOT_3_DIRECTION: set to 1, and the autopilot still says -1"):
        set_parameter(FakeAutopilot(dict(SOME), deaf_to=frozenset({"MOT_3_DIRECTION"})), "MOT_3_DIRECTION", 1.0)
    with pytest.raises(EnvironmentFailure, match="does not know it"):
        set_parameter(FakeAutopilot(dict(SOME)), "NOT_THERE", 1.0)
    for name, value in (("scr", 1.0), ("A" * 17, 1.0), ("SCR_ENABLE", float("nan"))):
        with pytest.raises(InputError, match="parameter"):
            set_parameter(FakeAutopilot(dict(SOME)), name, value)


def test_both_names_of_an_id_are_known() -> None:
    """The newer one first; none is none."""
    assert first_of({"SYSID_MYGCS": 255.0}, GROUND_NAMES) == ("SYSID_MYGCS", 255.0)
    assert first_of({"SYSID_MYGCS": 255.0, "MAV_GCS_SYSID": 250.0}, GROUND_NAMES) == ("MAV_GCS_SYSID", 250.0)
    assert first_of({}, GROUND_NAMES) is None
    assert all(len(name) <= 16 for name in WANTED)


@pytest.mark.parametrize(
    "text",
    [
        "# Onboard parameters for Vehicle 1\n1\t1\tSCR_ENABLE\t1\t2\n1\t1\tMOT_3_DIRECTION\t-1\t2\n",
        "SCR_ENABLE,1\nMOT_3_DIRECTION,-1.0\n",
        "\ufeffSCR_ENABLE       1.000000\r\nMOT_3_DIRECTION  -1 # turned\r\n\r\n",
    ],
)
def test_files_of_three_ground_stations(tmp_path: Path, text: str) -> None:
    """QGroundControl's, Mission Planner's and MAVProxy's say the same."""
    path = tmp_path / "a.params"
    path.write_text(text, encoding="utf-8", newline="")
    assert read_parameter_file(path) == {"SCR_ENABLE": 1.0, "MOT_3_DIRECTION": -1.0}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"SCR_ENABLE,yes\n", "line 1: 'SCR_ENABLE,yes' is no parameter"),
        (b"SCR_ENABLE,1\n\nscr enable 1\n", "line 3"),
        (b"SCR_ENABLE,nan\n", "line 1"),
        (b"", "names no parameter"),
        (b"# only words\n", "names no parameter"),
        (b"\xff\xfe\x00", "no text"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    """With its line, and what would be right."""
    path = tmp_path / "a.params"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_parameter_file(path)


def test_no_file_is_refused(tmp_path: Path) -> None:
    """A folder or nothing at all: one line."""
    for path in (tmp_path, tmp_path / "none"):
        with pytest.raises(InputError, match=str(path)):
            read_parameter_file(path)


@given(st.binary(max_size=200))
@settings(max_examples=60, deadline=None)
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    """Nothing but an InputError comes of them."""
    path = tmp_path_factory.mktemp("any") / "a.params"
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        assert read_parameter_file(path)


@REAL
def test_real_files_are_read_whole() -> None:
    """Those that ArduPilot ships for the BlueROV2: every line of them."""
    for name in ("bluerov2-4_0_0.params", "bluerov2-heavy-4_0_0.params"):
        lines = [line for line in (DATA / name).read_text().splitlines() if line.strip()]
        assert len(read_parameter_file(DATA / name)) == len(lines)
