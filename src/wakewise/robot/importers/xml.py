"""XML read safely: no document types, no entities, limits on size and depth, and a line number on every element."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

MAX_BYTES = 4 * 1024 * 1024
"""Largest file that is read; vehicle descriptions are a few hundred kilobytes at most."""
MAX_MESSAGE = 600
LARGEST = 1e15
"""Numbers beyond this are no measure of a vehicle, in whatever unit."""
MAX_DEPTH = 80
MAX_ELEMENTS = 100_000
ENCODINGS = frozenset({"utf-8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "windows-1252", "utf-16"})

_DECLARED = re.compile(rb"""^\s*<\?xml[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")


@dataclass(frozen=True)
class SourceLocation:
    """A file and a line in it, for messages."""

    file: Path
    line: int

    def __str__(self) -> str:
        """As compilers write it: `file:line`."""
        return f"{self.file}:{self.line}"

    @property
    def short(self) -> str:
        """The same without folders, for notes."""
        return f"{self.file.name}:{self.line}"


class PlacedError(InputError):
    """A fault whose message already says file and line; a file's own words in it are cut to a readable length."""

    def __init__(self, message: str) -> None:
        super().__init__(message if len(message) <= MAX_MESSAGE else message[: MAX_MESSAGE - 3] + "...")


@dataclass(eq=False)
class Element:
    """One XML element; `text` joins the character data directly inside it."""

    tag: str
    attributes: dict[str, str]
    place: SourceLocation
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def all(self, tag: str) -> list[Element]:
        """Children with this tag."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Element | None:
        """First child with this tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def child(self, tag: str) -> Element:
        """First child with this tag; an empty element in this place if there is none."""
        return self.first(tag) or Element(tag, {}, self.place)

    def value(self, tag: str) -> str | None:
        """Stripped text of the first child with this tag; None if there is none or it is empty."""
        return self.child(tag).text.strip() or None

    @property
    def name(self) -> str:
        """Its attribute `name`; "" if there is none."""
        return self.attributes.get("name", "")

    def number(self, tag: str) -> float | None:
        """Number in the first child with this tag; None if there is none. Raises InputError if it is no number."""
        text = self.value(tag)
        return None if text is None else number(text, self.child(tag).place, tag)

    def numbers(self, tag: str, count: int | None = None) -> Array | None:
        """Numbers in the first child with this tag; None if there are none."""
        text = self.value(tag)
        return None if text is None else numbers(text, self.child(tag).place, tag, count)

    def number_attribute(self, key: str, what: str = "") -> float | None:
        """Number in an attribute, which messages call `what` or by its key; None if there is none."""
        text = self.attributes.get(key)
        return None if text is None else number(text, self.place, what or key)

    def walk(self) -> Iterator[Element]:
        """The element and everything below it, parents first."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


def read_bytes(path: Path) -> bytes:
    """Read a whole file of ordinary size.

    Raises InputError if it is not a readable regular file or is larger than `MAX_BYTES`.
    """
    try:
        if not path.is_file():
            raise InputError(f"{path}: not found or not a file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputError(f"{path}: {size} bytes, vehicle files of at most {MAX_BYTES} bytes are read")
        data = path.read_bytes()
    except (OSError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read ({fault})") from fault
    return data


def read_text(path: Path) -> str:
    """Read a text file in UTF-8, or in the encoding that its XML declaration names.

    Raises InputError if the bytes are not text in that encoding.
    """
    data = read_bytes(path)
    encoding = "utf-8"
    declared = _DECLARED.match(data[:200])
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif declared is not None:
        encoding = declared.group(1).decode("ascii").lower()
        if encoding not in ENCODINGS:
            raise InputError(f"{path}:1: encoding {encoding}, allowed {', '.join(sorted(ENCODINGS))}")
    try:
        text = data.decode("utf-8-sig" if encoding == "utf-8" else encoding)
    except UnicodeDecodeError as fault:
        line = data[: fault.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: not {encoding} text ({fault.reason} at byte {fault.start})") from fault
    if "\0" in text:
        raise InputError(f"{path}:{text[: text.index(chr(0))].count(chr(10)) + 1}: holds a NUL, so it is not text")
    return text


def parse_xml(text: str, path: Path) -> Element:
    """Parse XML text into elements with line numbers.

    A prefix that the file binds to the xacro namespace becomes `xacro:`, whatever the file calls it.

    Raises InputError if the text is not well formed, declares a document type or an entity, or exceeds the limits
    above.
    """
    builder = _Builder(path)
    try:
        builder.parser.Parse(text.encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as fault:
        raise InputError(f"{path}:{fault.lineno}: not well-formed XML ({expat.ErrorString(fault.code)})") from fault
    if builder.root is None:
        raise InputError(f"{path}:1: holds no XML element")
    return builder.root


class _Builder:
    """Collects expat's events into a tree."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root: Element | None = None
        self.stack: list[Element] = []
        self.count = 0
        self.xacro_prefixes = {"xacro"}
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.EntityDeclHandler = self._doctype

    def _here(self) -> SourceLocation:
        return SourceLocation(self.path, self.parser.CurrentLineNumber)

    def _doctype(self, *_: object) -> None:
        raise PlacedError(f"{self._here()}: declares a document type or entity, vehicle files must not")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if len(self.stack) >= MAX_DEPTH:
            raise PlacedError(f"{self._here()}: elements nested more than {MAX_DEPTH} deep")
        if self.count > MAX_ELEMENTS:
            raise PlacedError(f"{self._here()}: more than {MAX_ELEMENTS} elements")
        for name, value in attributes.items():
            if name.startswith("xmlns:") and "xacro" in value:
                self.xacro_prefixes.add(name[len("xmlns:") :])
        prefix, colon, local = tag.partition(":")
        if colon and prefix in self.xacro_prefixes:
            tag = f"xacro:{local}"
        element = Element(tag, dict(attributes), self._here())
        if self.stack:
            self.stack[-1].children.append(element)
        elif self.root is None:
            self.root = element
        self.stack.append(element)

    def _end(self, _tag: str) -> None:
        self.stack.pop()

    def _text(self, data: str) -> None:
        if self.stack:
            self.stack[-1].text += data


def number(text: str, place: SourceLocation, what: str) -> float:
    """Turn text into a finite number.

    Raises InputError naming the place and what the number means.
    """
    try:
        value = float(text)
    except ValueError:
        raise PlacedError(f"{place}: {what} is {_short(text)}, must be a number") from None
    if not math.isfinite(value):
        raise PlacedError(f"{place}: {what} is {_short(text)}, must be finite")
    if abs(value) > LARGEST:
        raise PlacedError(f"{place}: {what} is {_short(text)}, must be at most {LARGEST:g}")
    return value


def numbers(text: str, place: SourceLocation, what: str, count: int | None = None) -> Array:
    """Turn text of numbers separated by blanks or commas into an array; `count` fixes how many."""
    parts = text.replace(",", " ").split()
    if count is not None and len(parts) != count:
        raise PlacedError(f"{place}: {what} has {len(parts)} numbers, must have {count}")
    return np.array([number(part, place, what) for part in parts], dtype=np.float64)


def _short(text: str) -> str:
    text = " ".join(text.split())
    return repr(text if len(text) <= 40 else text[:37] + "...")
