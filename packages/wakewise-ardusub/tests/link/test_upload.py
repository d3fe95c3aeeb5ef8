"""The script's way onto the autopilot's card, over a link that loses and repeats."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import pytest

from fake_autopilot import FakeAutopilot
from wakewise.core.errors import EnvironmentFailure
from wakewise_ardusub.link.script import script_text
from wakewise_ardusub.link.upload import upload_script

SCRIPT = script_text().encode("utf-8")
_HEAD = struct.Struct("<HBBBBBxI")


@dataclass
class Card:
    """The files of an autopilot, one open at a time; a repeated request is answered as before."""

    folders: set[str] = field(default_factory=lambda: {"/APM/scripts"})
    makes: tuple[str, ...] = ()
    files: dict[str, bytes] = field(default_factory=dict)
    refuses: int = 0
    """An operation that is answered with a refusal."""
    damages: bool = False
    _open: str | None = None
    _last: tuple[bytes, bytes] | None = None

    def link(self, **kwargs: Any) -> FakeAutopilot:
        link = FakeAutopilot(**kwargs)
        link.on["FILE_TRANSFER_PROTOCOL"] = lambda heard: self._serve(link, bytes(heard.payload))
        return link

    def _serve(self, link: FakeAutopilot, payload: bytes) -> None:
        if self._last is None or self._last[0] != payload:
            number, _, operation, size, _, _, offset = _HEAD.unpack_from(payload)
            code, data = self._do(operation, payload[12 : 12 + size], offset)
            head = _HEAD.pack((number + 1) % 65536, 5, code, len(data), operation, 0, offset)
            self._last = payload, (head + data).ljust(251, b"\0")
        link.say(
            "file_transfer_protocol",
            target_network=0,
            target_system=1,
            target_component=191,
            payload=self._last[1],
        )

    def _do(self, operation: int, data: bytes, offset: int) -> tuple[int, bytes]:
        if operation == self.refuses:
            return 129, b"\x02\x1c"
        name = data.decode("latin-1")
        if operation in (1, 2):
            self._open = None
        elif operation == 3:
            return (129, b"\x06") if name in self.folders else (129, b"\x02\x02")
        elif operation == 9:
            if name not in self.makes:
                return 129, b"\x02\x02"
            self.folders.add(name)
        elif operation in (4, 6):
            assert self._open is None
            self._open = name
            if operation == 6:
                assert name.rpartition("/")[0] in self.folders
                self.files[name] = b""
        elif operation == 7:
            assert self._open is not None
            held = self.files[self._open]
            assert offset <= len(held)
            self.files[self._open] = held[:offset] + data + held[offset + len(data) :]
        elif operation == 5:
            assert self._open is not None
            found = self.files[self._open][offset : offset + 239]
            return (128, b"?" + found[1:] if self.damages else found) if found else (129, b"\x06")
        return 128, b""


@pytest.mark.parametrize("lose", [0, 5])
def test_it_is_there_as_it_was_sent(lose: int) -> None:
    """Also where every fifth packet is lost, either way; the progress ends at the whole."""
    card, seen = Card(), []
    link = card.link(lose=lambda where, count: lose > 0 and count % lose == 0)
    path = upload_script(link, SCRIPT, progress=lambda done, total: seen.append((done, total)))
    assert path == "/APM/scripts/wakewise.lua"
    assert card.files == {path: SCRIPT}
    assert seen[-1] == (len(SCRIPT), len(SCRIPT))


def test_it_goes_where_this_autopilot_looks() -> None:
    """On Linux boards scripts lie where the firmware runs; a folder that is missing is made."""
    assert upload_script(Card(folders={"./scripts"}).link(), SCRIPT) == "./scripts/wakewise.lua"
    made = Card(folders=set(), makes=("./scripts",))
    assert upload_script(made.link(), SCRIPT) == "./scripts/wakewise.lua"
    with pytest.raises(EnvironmentFailure, match="no folder for scripts: set SCR_ENABLE"):
        upload_script(Card(folders=set()).link(), SCRIPT)


def test_what_cannot_be_is_said() -> None:
    """No answer, a full card, or bytes that come back changed: one line each."""
    with pytest.raises(EnvironmentFailure, match="does not answer file transfers"):
        upload_script(Card().link(lose=lambda where, count: where == "in"), SCRIPT)
    with pytest.raises(EnvironmentFailure, match=r"wakewise\.lua: its file system refused"):
        upload_script(Card(refuses=7).link(), SCRIPT)
    with pytest.raises(EnvironmentFailure, match="not what was sent"):
        upload_script(Card(damages=True).link(), SCRIPT)
