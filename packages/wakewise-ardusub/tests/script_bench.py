"""The script as it is shipped, run by Lua 5.3 on a bench: an autopilot's bindings and nothing behind them.

Time stands still until a test moves it, so what holds for 250 ms can be asked for to the millisecond.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import lupa.lua53
from pymavlink.dialects.v20 import common

from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.script import script_text

# ArduPilot's millis() is no number of Lua but a box around 32 unsigned bits that wraps; what it is asked for here is.
_BINDINGS = """
local bench = ...
local box = {}
box.__index = box
local function boxed(value) return setmetatable({value = value & 0xFFFFFFFF}, box) end
box.__sub = function(a, b) return boxed(a.value - b.value) end
function box:toint() return self.value end
function millis() return boxed(bench.millis()) end
gcs = {}
function gcs:send_text(severity, text) bench.text(severity, text) end
function gcs:send_named_float(name, value) bench.named_float(name, value) end
param = {}
function param:get(name) return bench.get(name) end
function param:add_table(key, prefix, count) return bench.add_table(key, prefix, count) end
function param:add_param(key, index, name, default) return bench.add_param(key, index, name, default) end
local handle = {}
handle.__index = handle
function handle:init(name) self.name = name return bench.get(name) ~= nil end
function handle:get() return bench.get(self.name) end
function handle:set_and_save(value) return bench.save(self.name, value) end
function Parameter() return setmetatable({}, handle) end
mavlink = {}
function mavlink:init(queue, ids) bench.init(queue, ids) end
function mavlink:register_rx_msgid(id) return bench.register(id) end
function mavlink:receive_chan() return bench.receive() end
arming = {}
function arming:is_armed() return bench.armed() end
vehicle = {}
function vehicle:get_mode() return bench.mode() end
function vehicle:set_mode(mode) return bench.set_mode(mode) end
SRV_Channels = {}
function SRV_Channels:find_channel(func) return bench.find_channel(func) end
function SRV_Channels:set_output_pwm_chan_timeout(channel, pwm, ms) bench.override(channel, pwm, ms) end
"""


@dataclass
class Bench:
    """An autopilot of bindings: what the script is told, and what it does."""

    armed: bool = True
    mode: int = protocol.MANUAL
    functions: dict[int, int] = field(default_factory=lambda: {i: 33 + i for i in range(8)})
    """SERVOn_FUNCTION by channel from 0."""
    parameters: dict[str, float] = field(default_factory=lambda: {"SYSID_THISMAV": 1.0})
    now_ms: int = 0xFFFFFF00
    """Starts near the wrap of the autopilot's clock."""
    overrides: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By channel: pulse, and when its override ends."""
    texts: list[tuple[int, str]] = field(default_factory=list)
    floats: dict[str, float] = field(default_factory=dict)
    inbox: list[bytes] = field(default_factory=list)
    registered: list[int] = field(default_factory=list)
    modes: list[int] = field(default_factory=list)
    """Modes that the script set."""
    refused_modes: tuple[int, ...] = ()
    _update: Any = None
    _wait_ms: int = 0

    def load(self) -> None:
        """Start the script, as at a boot: parameters that were saved are there, switched on or not."""
        lua = lupa.lua53.LuaRuntime(encoding="latin-1", unpack_returned_tuples=True)
        calls = {
            "millis": lambda: self.now_ms & 0xFFFFFFFF,
            "text": lambda severity, text: self.texts.append((severity, text)),
            "named_float": self.floats.__setitem__,
            "get": self.parameters.get,
            "add_table": lambda key, prefix, count: 0 <= key <= 200 and count < 64,
            "add_param": self._add,
            "save": self._save,
            "init": lambda queue, ids: None,
            "register": self.registered.append,
            "receive": lambda: self.inbox.pop(0).decode("latin-1") if self.inbox else None,
            "armed": lambda: self.armed,
            "mode": lambda: self.mode,
            "set_mode": self._set_mode,
            "find_channel": self._find,
            "override": self._override,
        }
        lua.execute(_BINDINGS, lua.table_from(calls))
        self._update, self._wait_ms = lua.execute(script_text())

    def _add(self, _key: int, _index: int, name: str, default: float) -> bool:
        self.parameters.setdefault(f"WKW_{name}", float(default))
        return True

    def _save(self, name: str, value: float) -> bool:
        self.parameters[name] = float(value)
        return True

    def _set_mode(self, mode: int) -> bool:
        self.modes.append(mode)
        if mode in self.refused_modes:
            return False
        self.mode = mode
        return True

    def _find(self, function: int) -> int | None:
        return next((channel for channel, found in sorted(self.functions.items()) if found == function), None)

    def _override(self, channel: int, pwm: int, ms: int) -> None:
        assert isinstance(pwm, int)
        assert 800 <= pwm <= 2200
        self.overrides[channel] = (pwm, self.now_ms + ms)

    def step(self, *messages: bytes, times: int = 1) -> None:
        """Hand messages over and run the script's loop."""
        self.inbox += messages
        for _ in range(times):
            self.now_ms += self._wait_ms
            self._update, self._wait_ms = self._update()

    def enable(self) -> None:
        """What the pilot does to let the companion act."""
        self.parameters[protocol.ENABLE_PARAMETER] = 1.0

    @property
    def pulses(self) -> dict[int, int]:
        """Pulse by channel where an override acts now."""
        return {channel: pwm for channel, (pwm, until) in self.overrides.items() if self.now_ms < until}

    @property
    def why(self) -> int:
        """What the script last gave as its reason."""
        return int(self.floats[protocol.REASON_NAME])


def stored(message: Any, *, system: int = 1, component: int = 191, length: int | None = None) -> bytes:
    """A message as ArduPilot hands it to Lua: its mavlink_message_t of 291 bytes, not the bytes of the wire.

    checksum, magic, length, incompatibility and compatibility flags, sequence, system, component, 3 bytes of id, a
    payload of 264 bytes, its checksum and a signature. `length` leaves zeros at the end of the payload out, as MAVLink
    2 does, and fills them up with what an older message left there.
    """
    packed = message.pack(common.MAVLink(None, srcSystem=system, srcComponent=component), force_mavlink1=False)
    payload = packed[10:-2].ljust(protocol.THRUST_BYTES, b"\0")
    sent = len(payload.rstrip(b"\0")) if length is None else length
    assert not any(payload[sent:])
    head = b"\x11\x22" + bytes([0xFD, sent, 0, 0, packed[4], system, component])
    head += int(message.get_msgId()).to_bytes(3, "little")
    return (head + payload[:sent].ljust(264, b"\xaa") + b"\x33\x44" + bytes(13)).ljust(291, b"\0")


def thrusts(values: list[float], time_us: int, *, group: int = 0, target: int = 1, **who: int) -> bytes:
    """Motor values as the script is handed them."""
    padded = [*values, *[float("nan")] * (8 - len(values))]
    return stored(
        common.MAVLink_set_actuator_control_target_message(time_us, group, target, 1, padded),
        **who,
    )
