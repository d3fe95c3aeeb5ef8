"""Reader of ArduPilot's dataflash logs (.BIN): records that begin with A3 95 and a type, described by FMT records.

The format has no checksums. A record counts as bad if its type was never described; so does a stretch of bytes in which
no record begins. After damage the reader resynchronises where a record is followed by another. A record without a time
gets the time of the last record that had one, as parameters, events and messages of old logs need. A record with other
fields than are known is whole and is counted by its name.

The reader is our own and not pymavlink's `DFReader`, because that does not report damage. Whole logs give the same
number of records (a test compares them). On 200 damaged copies of a log of 850 records (1 to 12 changed, removed or
inserted stretches), DFReader reported no bad record, decoded up to 353 records by a damaged description, raised an
exception on 6 copies, and printed each skipped byte to the console on most of them.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any

from wakewise_ardusub.logs.channels import SERVOS, LogCollector, SystemRecords, firmware_of
from wakewise_ardusub.logs.mavlink import DOWNWARD

HEAD = b"\xa3\x95"
_FMT_TYPE, _FMT_LENGTH = 128, 89
_FMT = struct.Struct("<BB4s16s64s")
# Letters of FMT: how a field is packed, and what it is multiplied by (ArduPilot, AP_Logger/LogStructure.h).
_CODES: dict[str, tuple[str, float | None]] = {
    "b": ("b", 1.0), "B": ("B", 1.0), "M": ("B", 1.0), "h": ("h", 1.0), "H": ("H", 1.0), "i": ("i", 1.0),
    "I": ("I", 1.0), "q": ("q", 1.0), "Q": ("Q", 1.0), "f": ("f", 1.0), "d": ("d", 1.0), "g": ("e", 1.0),
    "c": ("h", 0.01), "C": ("H", 0.01), "e": ("i", 0.01), "E": ("I", 0.01), "L": ("i", 1e-7),
    "n": ("4s", None), "N": ("16s", None), "Z": ("64s", None), "a": ("64s", None),
}  # fmt: skip
_WANTED = frozenset(
    {"ATT", "RCOU", "RCIN", "CTUN", "BARO", "BAT", "MODE", "ARM", "EV", "PARM", "XKF1", "MSG", "VER", "BAR2"}
    | {"VISO", "RFND", "GPS"}
)
_ARMED_EVENT, _DISARMED_EVENT = 10, 11
_GOOD = 4
_EPOCH_S, _LEAP_S = 315_964_800.0, 18.0
"""Begin of GPS time (1980-01-06), and how far it is ahead of UTC since 2017."""
_MIDDLE_US, _HALF_US = 1500.0, 400.0


@dataclass(frozen=True)
class RecordFormat:
    """One kind of record: its name, its length with the head, how it is packed, and its fields."""

    name: str
    length: int
    packed: struct.Struct
    scales: tuple[float | None, ...]
    labels: tuple[str, ...]

    def read(self, body: bytes) -> dict[str, Any]:
        """Fields by name."""
        values = self.packed.unpack(body)
        return {
            label: value if scale is None else value * scale
            for label, value, scale in zip(self.labels, values, self.scales, strict=False)
        }


def read_dataflash(data: Any) -> LogCollector:
    """Read all records of a log of the autopilot, damaged or not."""
    collector = LogCollector()
    system_records = collector.records_of()
    formats: dict[int, RecordFormat] = {}
    at, size = 0, len(data)
    lost = False
    while at + 3 <= size:
        kind = data[at + 2]
        length = _FMT_LENGTH if kind == _FMT_TYPE else formats[kind].length if kind in formats else 0
        whole = data[at : at + 2] == HEAD and length > 0
        if whole and at + length > size:
            # The last record of a file that was cut, or damage that looks like one.
            collector.cut_short = data.find(HEAD, at + 1) < 0
            if collector.cut_short:
                break
            whole = False
        if whole and lost and data[at + length : at + length + 2] not in (HEAD, b""):
            whole = False
        if not whole:
            after = data.find(HEAD, at + 1)
            after = size if after < 0 else after
            if lost:
                collector.bad_bytes += after - at
            else:
                collector.count_bad("no record", after - at)
            at, lost = after, True
            continue
        lost = False
        body = bytes(data[at + 3 : at + length])
        at += length
        try:
            if kind == _FMT_TYPE:
                number, described = _format(body)
                formats[number] = described
            else:
                _take(collector, system_records, formats[kind], body)
        except (KeyError, TypeError, ValueError, struct.error):
            collector.count_bad("fields", length)
            continue
        collector.records += 1
    return collector


def _format(body: bytes) -> tuple[int, RecordFormat]:
    number, length, name, codes, labels = _FMT.unpack(body)
    text = codes.rstrip(b"\0").decode("ascii")
    parts = [_CODES[code] for code in text]
    packed = struct.Struct("<" + "".join(part for part, _ in parts))
    if packed.size + 3 != length:
        raise ValueError
    return number, RecordFormat(
        name=name.rstrip(b"\0").decode("ascii"),
        length=length,
        packed=packed,
        scales=tuple(scale for _, scale in parts),
        labels=tuple(labels.rstrip(b"\0").decode("ascii").split(",")),
    )


def _take(collector: LogCollector, system_records: SystemRecords, form: RecordFormat, body: bytes) -> None:
    if form.name not in _WANTED:
        return
    fields = form.read(body)
    time_s = collector.clock.now_s
    for label, second in (("TimeUS", 1e-6), ("TimeMS", 1e-3)):
        if label in fields:
            time_s = collector.clock.at(second * fields[label])
            break
    try:
        _keep(system_records, form.name, time_s, fields)
    except KeyError:
        collector.unread[form.name] += 1


def _keep(system_records: SystemRecords, name: str, time_s: float, fields: dict[str, Any]) -> None:
    """Keep what a record says; KeyError if it lacks a field that is needed."""
    match name:
        case "ATT":
            system_records.put("attitude", time_s, (_turn(fields[k]) for k in ("Roll", "Pitch", "Yaw")))
        case "RCOU":
            system_records.put("servo", time_s, (_output(fields, i) for i in range(1, SERVOS + 1)))
        case "RCIN":
            # ArduSub's channels: pitch, roll, throttle (up), yaw, forward, lateral.
            forward, right, up, turn = ((fields[f"C{i}"] - _MIDDLE_US) / _HALF_US for i in (5, 6, 3, 4))
            system_records.put("sticks", time_s, (max(-1.0, min(1.0, v)) for v in (forward, right, -up, turn)))
        case "CTUN":
            system_records.put("depth CTUN", time_s, (-fields["Alt"],))
        case "BARO":
            # The first is inside the hull; old logs have a kind of record for each.
            if fields.get("I", fields.get("Id", 0)) == 1:
                system_records.put("depth BARO", time_s, (-fields["Alt"],))
        case "BAR2":
            system_records.put("depth BARO", time_s, (-fields["Alt"],))
        case "XKF1":
            # The estimator's first core; the autopilot may change over to another, which MAVLink's position follows.
            if fields.get("C", 0) == 0:
                system_records.put("position", time_s, (fields[k] for k in ("PN", "PE", "PD")))
        case "VISO":
            system_records.put("dvl step", time_s, (fields[k] for k in ("PosDX", "PosDY", "PosDZ")))
        case "RFND":
            # A status of 4 is a distance within the sensor's range.
            if fields.get("Stat", _GOOD) == _GOOD and fields.get("Orient", DOWNWARD) == DOWNWARD:
                system_records.put("altitude", time_s, (fields["Dist"],))
        case "GPS":
            if fields["GWk"]:
                since_1980_s = 604_800.0 * fields["GWk"] + 1e-3 * fields["GMS"]
                system_records.put("calendar", time_s, (_EPOCH_S + since_1980_s - _LEAP_S,))
            if fields["Lat"] or fields["Lng"]:
                system_records.put("global", time_s, (fields["Lat"], fields["Lng"]))
        case "BAT":
            if fields.get("Inst", fields.get("Instance", fields.get("I", 0))) == 0:
                system_records.put("voltage", time_s, (fields["Volt"],))
        case "MODE":
            system_records.put("mode", time_s, (float(fields["ModeNum"] if "ModeNum" in fields else fields["Mode"]),))
        case "ARM":
            system_records.put("armed", time_s, (fields["ArmState"],))
        case "EV":
            if fields["Id"] in (_ARMED_EVENT, _DISARMED_EVENT):
                system_records.put("armed", time_s, (float(fields["Id"] == _ARMED_EVENT),))
        case "PARM":
            system_records.parameter(_text(fields["Name"]), float(fields["Value"]))
        case "MSG":
            system_records.firmware = system_records.firmware or firmware_of(_text(fields["Message"]))
        case "VER":
            system_records.firmware = firmware_of(_text(fields["FWS"])) or system_records.firmware


def _output(fields: dict[str, Any], number: int) -> float:
    """A servo output by its number from 1; old logs name them otherwise."""
    found = next((fields[f"{begin}{number}"] for begin in ("C", "Ch", "Chan") if f"{begin}{number}" in fields), 0)
    return float(found)


def _text(value: Any) -> str:
    if not isinstance(value, bytes):
        raise TypeError
    return value.partition(b"\0")[0].decode("ascii")


def _turn(degrees: float) -> float:
    """Radians in (-pi, pi]; headings are logged from 0 to 360."""
    return math.remainder(math.radians(degrees), 2.0 * math.pi) if math.isfinite(degrees) else math.nan
