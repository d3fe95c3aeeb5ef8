"""Xacro expanded safely: properties, arguments, macros, conditions and includes, within limits and within folders."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.robot.importers.packages import MissingFileError, PackagePaths
from wakewise.robot.importers.xacro_text import Macro, Scope, TextSubstitution, literal, parse_parameters
from wakewise.robot.importers.xml import MAX_ELEMENTS, Element, PlacedError, SourceLocation, parse_xml, read_text

_TRUE, _FALSE = frozenset({"true", "1", "yes"}), frozenset({"false", "0", "no", ""})


class XacroExpander:
    """Expands one xacro document.

    `folders`: finds packages and keeps includes inside. `arguments`: values of `$(arg NAME)` that the user gave.
    `skip_missing`: leave out includes that are not there, and calls of macros that then do not exist, each with a note;
    otherwise both are refused.
    """

    def __init__(self, folders: PackagePaths, arguments: Mapping[str, str], *, skip_missing: bool) -> None:
        self.folders = folders
        self.skip_missing = skip_missing
        self.told = dict(arguments)
        self.texts = TextSubstitution(folders, arguments)
        self.macros: dict[str, Macro] = {}
        self.notes: list[str] = []
        self.missing: list[str] = []
        self._including: list[Path] = []
        self._elements = 0
        self._undefined: dict[str, SourceLocation] = {}
        self._searched = False
        self._declared_arguments: set[str] = set()

    def expand(self, root: Element) -> Element:
        """Expand the document whose root element this is.

        Raises InputError with file and line, for anything that cannot be expanded.
        """
        scope = Scope(None)
        self._including.append(root.place.file.resolve())
        try:
            children = self._children(root, scope)
        except PlacedError as fault:
            if not self.missing or "is not defined" not in str(fault):
                raise
            raise PlacedError(f"{fault} (perhaps in {self.missing[0]}, which was left out)") from fault
        defaults = {name: value for name, value in self.texts.arguments.items() if name not in self.told}
        if defaults:
            said = ", ".join(f"{name}:={value!r}" for name, value in sorted(defaults.items())[:8])
            self.notes.append(f"xacro arguments at their defaults: {said}")
        unknown = sorted(name for name in self.told if name not in self._declared_arguments)
        if unknown:
            raise InputError(f"{root.place.file}: has no xacro argument {', '.join(unknown)}")
        if self._undefined:
            said = ", ".join(sorted(self._undefined)[:12])
            self.notes.append(f"macros left out, since their files are missing: {said}")
        attributes = {k: self.texts.string(v, scope, root.place) for k, v in root.attributes.items()}
        return Element(root.tag, attributes, root.place, children)

    # elements

    def _children(self, parent: Element, scope: Scope) -> list[Element]:
        result: list[Element] = []
        for child in parent.children:
            result.extend(self._element(child, scope))
        return result

    def _element(self, element: Element, scope: Scope) -> list[Element]:
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise PlacedError(f"{element.place}: expands to more than {MAX_ELEMENTS} elements")
        if not element.tag.startswith("xacro:"):
            expanded = Element(
                element.tag,
                {k: self.texts.string(v, scope, element.place) for k, v in element.attributes.items()},
                element.place,
            )
            expanded.text = self.texts.string(element.text, scope, element.place)
            expanded.children = self._children(element, scope)
            return [expanded]
        match element.tag.removeprefix("xacro:"):
            case "property":
                self._property(element, scope)
            case "arg":
                self._argument(element, scope)
            case "include":
                return self._include(element, scope)
            case "macro":
                self._define(element, scope)
            case "if" | "unless" as word:
                if self._condition(element, scope) is (word == "if"):
                    return self._children(element, scope)
            case "insert_block":
                return self._insert(element, scope)
            case "element":
                name = self.texts.string(self._needed(element, "xacro:name"), scope, element.place)
                rest = {k: v for k, v in element.attributes.items() if k != "xacro:name"}
                return self._element(Element(name, rest, element.place, element.children, element.text), scope)
            case "attribute":
                raise PlacedError(f"{element.place}: xacro:attribute is not read")
            case "call":
                name = self.texts.string(self._needed(element, "macro"), scope, element.place)
                rest = {k: v for k, v in element.attributes.items() if k != "macro"}
                return self._call(Element(f"xacro:{name}", rest, element.place, element.children), scope)
            case _:
                return self._call(element, scope)
        return []

    def _needed(self, element: Element, name: str) -> str:
        if name not in element.attributes:
            raise PlacedError(f"{element.place}: {element.tag} needs the attribute {name}")
        return element.attributes[name]

    def _property(self, element: Element, scope: Scope) -> None:
        name = self._needed(element, "name")
        target = {"parent": scope.parent or scope, "global": scope.top}.get(element.attributes.get("scope", ""), scope)
        if "default" in element.attributes:
            if name in scope:
                return
            target.set_raw(name, element.attributes["default"], element.place)
        elif "value" in element.attributes:
            raw = element.attributes["value"]
            if target is scope:
                target.set_raw(name, raw, element.place)
            else:
                target.values[name] = literal(self.texts.value(raw, scope, element.place))
        elif element.attributes.get("remove") == "true":
            target.values.pop(name, None)
        else:
            target.blocks[name] = (Element("block", {}, element.place, self._children(element, scope)), True)

    def _argument(self, element: Element, scope: Scope) -> None:
        name = self._needed(element, "name")
        self._declared_arguments.add(name)
        if name not in self.texts.arguments and "default" in element.attributes:
            self.texts.arguments[name] = self.texts.string(element.attributes["default"], scope, element.place)

    def _include(self, element: Element, scope: Scope) -> list[Element]:
        place = element.place
        written = self._needed(element, "filename")
        name = self.texts.string(written, scope, place)
        if any(mark in name for mark in "*?["):
            raise PlacedError(f"{place}: include {written!r}: patterns are not read, name the files")
        try:
            path = self.folders.locate(name, place.file.parent, place)
            if not path.is_file():
                raise MissingFileError(f"{place}: include {written}: no such file")
        except MissingFileError as fault:
            if element.attributes.get("optional", "").lower() == "true":
                return []
            if not self.skip_missing:
                raise PlacedError(f"{fault} (--skip-missing leaves it out)") from fault
            self.missing.append(name)
            self.notes.append(f"include left out, not found: {written} ({place.short})")
            return []
        if path in self._including:
            raise PlacedError(f"{place}: include {written}: includes itself")
        with self.texts.deeper(place):
            self._including.append(path)
            root = parse_xml(read_text(path), path)
            prefix = element.attributes.get("ns")
            if prefix is None:
                children = self._children(root, scope)
            else:
                inner = Scope(scope)
                before = dict(self.macros)
                children = self._children(root, inner)
                for key, macro in [(k, m) for k, m in self.macros.items() if before.get(k) is not m]:
                    self.macros[f"{prefix}.{key}"] = macro
                for key in list(inner.raws) + list(inner.values):
                    scope.values[f"{prefix}.{key}"] = self.texts.lookup(key, inner)
            self._including.pop()
        return children

    def _condition(self, element: Element, scope: Scope) -> bool:
        value = self.texts.value(self._needed(element, "value"), scope, element.place)
        if isinstance(value, str):
            word = value.strip().lower()
            if word in _TRUE | _FALSE:
                return word in _TRUE
            value = literal(word)
        if isinstance(value, str):
            raise PlacedError(f"{element.place}: condition {value[:40]!r} is neither true nor false")
        return bool(value)

    # macros

    def _define(self, element: Element, scope: Scope) -> None:
        name = self._needed(element, "name").removeprefix("xacro:")
        parameters = parse_parameters(element.attributes.get("params", ""), element.place)
        self.macros[name] = Macro(name, parameters, element, scope)

    def _call(self, element: Element, scope: Scope) -> list[Element]:
        name = element.tag.removeprefix("xacro:")
        macro = self.macros.get(name)
        if macro is None and self.missing and not self._searched:
            self._read_beside_missing()
            macro = self.macros.get(name)
        if macro is None:
            if self.missing:
                self._undefined.setdefault(name, element.place)
                return []
            raise PlacedError(f"{element.place}: macro {name} is not defined")
        inner = Scope(scope)
        given = dict(element.attributes)
        with self.texts.deeper(element.place):
            blocks = self._children(element, scope)
            for parameter in macro.parameters:
                if parameter.block:
                    if not blocks:
                        raise PlacedError(
                            f"{element.place}: macro {name} needs a block {parameter.name}{self._by(macro)}"
                        )
                    inner.blocks[parameter.name] = (blocks.pop(0), parameter.block == "**")
                elif parameter.name in given:
                    raw = given.pop(parameter.name)
                    inner.values[parameter.name] = literal(self.texts.value(raw, scope, element.place))
                elif parameter.forward and parameter.name in scope:
                    inner.values[parameter.name] = self.texts.lookup(parameter.name, scope)
                elif parameter.default is not None:
                    inner.values[parameter.name] = literal(self.texts.value(parameter.default, scope, element.place))
                else:
                    raise PlacedError(
                        f"{element.place}: macro {name} needs the parameter {parameter.name}{self._by(macro)}"
                    )
            extra = [key for key in given if not key.startswith("xmlns")]
            if extra:
                raise PlacedError(f"{element.place}: macro {name} has no parameter {', '.join(extra)}{self._by(macro)}")
            return self._children(macro.body, inner)

    def _by(self, macro: Macro) -> str:
        """Where a macro was defined, if in another package than the file's own."""
        whence = self.folders.whence(macro.body.place.file)
        return f" (defined in {macro.body.place.short}{whence})" if whence else ""

    def _read_beside_missing(self) -> None:
        """Take macros from the files that lie where a missing include should be."""
        self._searched = True
        for name in list(self.missing):
            place = SourceLocation(self.folders.file, 1)
            try:
                folder = self.folders.locate(name, self.folders.file.parent, place).parent
            except InputError:
                continue
            for path in sorted(folder.glob("*.xacro"))[:50] if folder.is_dir() else []:
                root = parse_xml(read_text(path), path)
                taken = []
                for element in root.walk():
                    macro = element.name
                    if element.tag == "xacro:macro" and macro not in self.macros:
                        self._define(element, Scope(None))
                        taken.append(macro)
                if taken:
                    lost = Path(name).name
                    self.notes.append(
                        f"{len(taken)} macros taken from {path.name}, which lies beside the missing {lost}"
                    )

    def _insert(self, element: Element, scope: Scope) -> list[Element]:
        name = self.texts.string(self._needed(element, "name"), scope, element.place)
        found = scope.block(name)
        if found is None:
            raise PlacedError(f"{element.place}: block {name} is not defined")
        block, only_children = found
        self._elements += sum(1 for _ in block.walk())
        if self._elements > MAX_ELEMENTS:
            raise PlacedError(f"{element.place}: expands to more than {MAX_ELEMENTS} elements")
        return list(block.children) if only_children else [block]
