"""Photographs at sea: by a camera that MAVLink reaches, or by a program; and from where they were taken."""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest

from bottle import Bottle
from loopback_sea import until
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.vision.reconstruction import read_reference_cameras
from wakewise_ardusub.link.session_log import SessionLog, read_journal
from wakewise_ardusub.session.cameras import CAMERAS_FILE, PHOTOGRAPHS, note_view, parse_camera, photo_name

WRITES = f"run:{sys.executable} -c \"import sys; open(sys.argv[1], 'w').write(sys.argv[2])\" {{file}} {{number}}"


def asked(bottle: Bottle):
    """Commands that left."""
    return [fields for _, name, fields in bottle.sent if name == "command_long" and fields["command"] in (2000, 203)]


@pytest.mark.parametrize(
    ("way", "command", "numbers"),
    [("mavlink", 2000, {"param3": 1.0, "param4": 7.0}), ("digicam", 203, {"param5": 1.0})],
)
def test_a_camera_is_asked_over_mavlink(way, command, numbers, tmp_path):
    """One image, of every component of the vehicle, without an interval, whether the companion drives or not."""
    bottle = Bottle()
    camera = parse_camera(way)(bottle.gate, tmp_path, SessionLog(tmp_path / "j"))
    camera.take(7)
    camera.close()
    (fields,) = asked(bottle)
    assert (fields["command"], fields["target_system"], fields["target_component"]) == (command, 1, 0)
    assert {name: fields[name] for name in numbers} == numbers
    assert fields["param2"] == 0.0
    bottle.gate.end("over")
    camera.take(8)
    assert len(asked(bottle)) == 1


def test_what_the_camera_answers_is_known_and_kept(tmp_path):
    """A refusal in words, an image with where it lies; answers to others are not ours."""
    journal = SessionLog(tmp_path / "j")
    bottle = Bottle(journal=journal)
    bottle.say("COMMAND_ACK", command=2000, result=3, target_component=191)
    assert bottle.gate.known.camera == "component 1 takes none: unsupported"
    bottle.now_s += 1.0
    bottle.say("COMMAND_ACK", component=100, command=2000, result=0, target_component=190)
    bottle.say("COMMAND_ACK", command=400, result=0, target_component=191)
    assert "unsupported" in bottle.gate.known.camera
    bottle.say("CAMERA_IMAGE_CAPTURED", component=100, capture_result=1, image_index=4, file_url=b"http://c/4.jpg\0")
    assert bottle.gate.known.camera == "component 100 took image 4, http://c/4.jpg"
    bottle.say("CAMERA_IMAGE_CAPTURED", component=100, capture_result=0, image_index=5, file_url="")
    bottle.say("CAMERA_IMAGE_CAPTURED", component=100, capture_result="?", image_index=5, file_url="")
    assert bottle.gate.known.photographs == 1
    assert bottle.gate.known.garbage == 1
    journal.close()
    told = [line["words"] for line in read_journal(tmp_path / "j")[0] if line["event"] == "camera"]
    assert told[:2] == ["component 1 takes none: unsupported", "component 100 took image 4, http://c/4.jpg"]


def test_a_program_takes_the_photographs_beside_the_flight(tmp_path):
    """Nobody waits for it; each photograph is a file with its number, and the journal says how each went."""
    journal = SessionLog(tmp_path / "j")
    camera = parse_camera(WRITES)(Bottle().gate, tmp_path, journal)
    began_s = time.monotonic()
    for number in (1, 2):
        camera.take(number)
    assert time.monotonic() - began_s < 0.05
    until(lambda: len(journal.path.read_bytes().splitlines()) == 2, "two photographs", 30.0)
    camera.close()
    journal.close()
    assert [(tmp_path / PHOTOGRAPHS / photo_name(k)).read_text() for k in (1, 2)] == ["1", "2"]
    told = [line for line in read_journal(tmp_path / "j")[0] if line["event"] == "camera"]
    assert [(line["number"], line["there"], line["amiss"]) for line in told] == [(1, True, ""), (2, True, "")]


def test_photographs_that_wait_are_not_taken_as_the_camera_closes(tmp_path):
    """The one under way is finished; the journal names each that is dropped."""
    journal = SessionLog(tmp_path / "j")
    sleeps = f'run:{sys.executable} -c "import sys, time; open(sys.argv[1], chr(119)); time.sleep(1.0)" {{file}}'
    camera = parse_camera(sleeps)(Bottle().gate, tmp_path, journal)
    for number in range(1, 5):
        camera.take(number)
    until((tmp_path / PHOTOGRAPHS / photo_name(1)).exists, "the first photograph", 30.0)
    camera.close()
    journal.close()
    told = [line for line in read_journal(tmp_path / "j")[0] if line["event"] == "camera"]
    assert [(line["number"], line["there"]) for line in told] == [(1, True), (2, False), (3, False), (4, False)]
    assert [line["amiss"] for line in told] == ["", *["not taken: the session ended"] * 3]


def test_a_program_that_fails_is_told_of_and_ends_nothing(tmp_path):
    """Its last words are in the journal."""
    journal = SessionLog(tmp_path / "j")
    camera = parse_camera("run:ls /no-such-place")(Bottle().gate, tmp_path, journal)
    camera.take(1)
    camera.close()
    journal.close()
    (line,) = [line for line in read_journal(tmp_path / "j")[0] if line["event"] == "camera"]
    assert not line["there"]
    assert "no-such-place" in line["amiss"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("mavlnk", "right is mavlink, digicam, or run:PROGRAM"),
        ("run:", "nothing to run"),
        ("run:no-such-program {file}", "there is no program no-such-program"),
        ("run:echo 'half", "No closing quotation"),
    ],
)
def test_words_that_are_no_camera(words, said):
    """In one line, before anything is connected."""
    with pytest.raises(InputError, match=said):
        parse_camera(words)


def test_where_photographs_were_taken_is_a_table_that_reconstruct_takes(tmp_path):
    """Camera centres by the photographs' names, to a micrometre."""
    centres = np.array([[0.1, -2.5, 1.25], [3.0, 0.0, 1.3]])
    for number, centre in enumerate(centres, start=1):
        note_view(tmp_path, number, Pose(centre, np.array([1.0, 0.0, 0.0, 0.0])), 0.5 * number)
    found = read_reference_cameras(tmp_path / CAMERAS_FILE)
    assert list(found) == [photo_name(1), photo_name(2)]
    np.testing.assert_allclose(np.array(list(found.values())), centres, atol=1e-6)
