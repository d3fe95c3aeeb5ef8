"""Commands to track a target in the picture: read from real bytes, checked, and answered."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from bottle import Bottle
from wakewise.core.errors import InputError
from wakewise_ardusub.link.message_state import LinkState, MavlinkMessage, update_link_state
from wakewise_ardusub.link.tracking_commands import (
    CAMERA_STOP_TRACKING,
    CAMERA_TRACK_POINT,
    CAMERA_TRACK_RECTANGLE,
    checked_box,
    command_ack,
    status_text,
    tracking_command,
    tracking_status,
)


def heard(message, system: int = 255, component: int = 190) -> MavlinkMessage:
    """A message as it comes off the wire."""
    (found,) = mavlink.MAVLink(None).parse_buffer(message.pack(mavlink.MAVLink(None, system, component)))
    return MavlinkMessage.of(found)


def order(command: int, *numbers: float, target: tuple[int, int] = (1, 191), confirmation: int = 0) -> MavlinkMessage:
    padded = [*numbers, *[0.0] * (7 - len(numbers))]
    return heard(mavlink.MAVLink_command_long_message(*target, command, confirmation, *padded))


def test_the_numbers_are_those_of_mavlink():
    """Commands as pymavlink's dialect has them."""
    assert CAMERA_TRACK_POINT == mavlink.MAV_CMD_CAMERA_TRACK_POINT
    assert CAMERA_TRACK_RECTANGLE == mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE
    assert CAMERA_STOP_TRACKING == mavlink.MAV_CMD_CAMERA_STOP_TRACKING


def test_a_box_comes_off_the_wire():
    """Sent to the companion, or to all components, of this vehicle; commands to others and other commands are none."""
    for component in (191, 0):
        found = tracking_command(order(2005, 0.2, 0.3, 0.5, 0.6, target=(1, component)), 1)
        assert found is not None
        assert found.box(4 / 3) == pytest.approx((0.2, 0.3, 0.5, 0.6), abs=1e-6)
        assert (found.system, found.component) == (255, 190)
    assert tracking_command(order(2005, 0.2, 0.3, 0.5, 0.6, target=(1, 100)), 1) is None
    assert tracking_command(order(2005, 0.2, 0.3, 0.5, 0.6, target=(2, 191)), 1) is None
    assert tracking_command(order(400, 1.0), 1) is None
    assert tracking_command(heard(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), 1) is None


def test_a_point_is_a_box_about_it():
    """As high as wide on the screen, cut at the picture's edge; without a radius it is a click of 12 % of the width."""
    given = tracking_command(order(2004, 0.5, 0.5, 0.1), 1)
    assert given is not None
    assert given.box(4 / 3) == pytest.approx((0.4, 0.5 - 0.4 / 3, 0.6, 0.5 + 0.4 / 3), abs=1e-6)
    for radius in (0.0, math.nan):
        click = tracking_command(order(2004, 0.0, 0.5, radius), 1)
        assert click is not None
        assert click.box(4 / 3) == pytest.approx((0.0, 0.42, 0.06, 0.58), abs=1e-6)
    stop = tracking_command(order(2010), 1)
    assert stop is not None
    assert stop.box(4 / 3) is None
    for u in (1.2, math.nan):
        outside = tracking_command(order(2004, u, 0.5, 0.1), 1)
        assert outside is not None
        with pytest.raises(InputError, match="outside the picture"):
            outside.box(4 / 3)


@pytest.mark.parametrize(
    ("edges", "words"),
    [
        ((0.2, 0.3, math.nan, 0.6), "must be four finite numbers"),
        ((0.2, 0.3, math.inf, 0.6), "must be four finite numbers"),
        ((0.2, 0.3, 1.5, 0.6), "outside the picture, 0 to 1"),
        ((-0.1, 0.3, 0.5, 0.6), "outside the picture, 0 to 1"),
        ((0.2, 0.3, 0.2, 0.6), "too small"),
        ((0.5, 0.3, 0.2, 0.6), "too small"),
        ((0.2, 0.3, 0.5), "must be four finite numbers"),
    ],
)
def test_what_is_no_box_is_refused_in_one_line(edges, words):
    """Naming the box and what would be right."""
    with pytest.raises(InputError, match=words) as fault:
        checked_box(edges)
    assert str(fault.value).startswith("box ")
    assert "\n" not in str(fault.value)


def test_answers_go_onto_the_wire():
    """To whom the command came from; one line of 50 bytes; edges that are not in the picture are NaN."""
    found = tracking_command(order(2005, 0.2, 0.3, 0.5, 0.6), 1)
    assert found is not None
    mav = mavlink.MAVLink(None, 1, 191)
    ack = mav.command_ack_encode(**command_ack(found, 2))
    text = mav.statustext_encode(**status_text("w" * 80))
    status = mav.camera_tracking_image_status_encode(**tracking_status((0.1, 0.2, 0.3, math.nan)))
    back = [mavlink.MAVLink(None).parse_buffer(one.pack(mav))[0] for one in (ack, text, status)]
    assert (back[0].command, back[0].result, back[0].target_system, back[0].target_component) == (2005, 2, 255, 190)
    assert back[1].text == "w" * 50
    assert back[2].rec_bottom_x == pytest.approx(0.3)
    assert math.isnan(back[2].rec_bottom_y)


def test_a_rangefinder_of_the_vehicle_is_known():
    """In metres by its orientation; what it cannot have measured, or is another vehicle's, changes nothing."""
    known = LinkState()
    for distance, turn, system in ((150, 25, 1), (9999, 0, 1), (0, 0, 1), (80, 0, 2)):
        said = mavlink.MAVLink_distance_sensor_message(0, 20, 3000, distance, 4, 0, turn, 0)
        known = update_link_state(known, heard(said, system, 194), 7.0)
    assert known.ranges == {25: (1.5, 7.0)}
    assert known.garbage == 0


def test_a_box_ends_no_engagement():
    """A ground station that designates a target does not take the vehicle over."""
    bottle = Bottle()
    assert bottle.engage() == "engaged"
    bottle.gate.take(order(2005, 0.2, 0.3, 0.5, 0.6))
    bottle.run(0.5)
    assert bottle.gate.entry is not None
