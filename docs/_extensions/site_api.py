"""Reference of the API: a page for each package that states what it exports in `__all__`, and types as links.

The pages lie in docs/api, which git ignores, and are written anew at each build.
"""

from __future__ import annotations

import ast
import builtins
import re
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

DOCS = Path(__file__).parents[1]
MODULES = ("wakewise.core.interfaces", "wakewise.core.errors", "wakewise.ui.plot")
"""Public modules that are no packages: all that they define without an underscore is public."""
SOURCES = [DOCS.parent / "src", *sorted((DOCS.parent / "packages").glob("*/src"))]


def _about(page: ast.Module) -> str:
    """First sentence of the docstring of a module."""
    first = " ".join((ast.get_docstring(page) or "").split("\n\n")[0].split())
    return re.split(r"(?<=[.:;])\s", first)[0].rstrip(".:;").replace("`", "``")


def public_modules() -> dict[str, str]:
    """Every package with an `__all__` and every module of MODULES, and the first line of its docstring."""
    found = {}
    for name in MODULES:
        path = SOURCES[0] / f"{name.replace('.', '/')}.py"
        if path.exists():
            found[name] = _about(ast.parse(path.read_text(encoding="utf-8")))
    for source in SOURCES:
        for path in sorted(source.glob("**/__init__.py")):
            page = ast.parse(path.read_text(encoding="utf-8"))
            states = any(
                isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__" for node in page.body
            )
            if states:
                name = ".".join(path.parent.relative_to(source).parts)
                found[name] = _about(page)
    return dict(sorted(found.items()))


def _write(app: Sphinx) -> None:
    folder = DOCS / "api"
    folder.mkdir(exist_ok=True)
    packages = public_modules()
    homes: dict[int, tuple[str, str]] = {}
    # `wakewise` itself first, then the deepest package: where a name is defined rather than passed on.
    for name in sorted(packages, key=lambda name: (name != "wakewise", -name.count("."), name)):
        for exported in _exported(name):
            homes.setdefault(id(getattr(import_module(name), exported)), (name, exported))
    pages = {"index": _index(packages)} | {name: _page(name, homes) for name in packages}
    for old in folder.glob("*.rst"):
        if old.stem not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / f"{name}.rst"
        # A page that is written is read again, which takes seconds for all of them.
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _index(packages: dict[str, str]) -> str:
    rows = [f"   * - :doc:`{name} <{name}>`\n     - {about}" for name, about in packages.items()]
    names = "\n".join(f"   {name}" for name in packages)
    return (
        "API reference\n=============\n\n"
        "Every public name, by package. ``import wakewise as ww`` gives the names of the first row, "
        ":doc:`from Python </python>` says how they fit together. Packages below the first line are public, too: "
        "what a package lists in ``__all__`` is what is shown here.\n\n"
        ".. list-table::\n   :header-rows: 1\n   :widths: 40 60\n\n   * - package\n     - what\n"
        f"{chr(10).join(rows)}\n\n"
        f".. toctree::\n   :hidden:\n   :maxdepth: 1\n\n{names}\n"
    )


def _exported(name: str) -> list[str]:
    """Names of a module that are public; constants, which may be one object by chance, have a page each."""
    module = import_module(name)
    return [each for each in getattr(module, "__all__", []) if callable(getattr(module, each))]


def _page(name: str, homes: dict[int, tuple[str, str]]) -> str:
    """A page of a module; what another page shows is named with a link to it."""
    module = import_module(name)
    elsewhere = {each: home for each in _exported(name) if (home := homes[id(getattr(module, each))]) != (name, each)}
    own = [each for each in getattr(module, "__all__", []) if each not in elsewhere]
    names = "".join(f"* :py:obj:`{each} <{name}.{each}>`\n" for each in sorted(own, key=str.lower) if each != "plot")
    listed = f".. rst-class:: names\n\n{names}\n" if names else ""
    text = f"{name}\n{'=' * len(name)}\n\n{listed}"
    text += f".. automodule:: {name}\n   :members:\n   :undoc-members:\n"
    if elsewhere:
        links = ", ".join(f":py:obj:`{each} <{'.'.join(home)}>`" for each, home in sorted(elsewhere.items()))
        text += f"   :exclude-members: {', '.join(sorted(elsewhere))}\n\nAlso exported here: {links}.\n"
    return text


def _escaped(line: str) -> str:
    """A line of text with its bars escaped, and code that is followed by a letter set apart from it."""
    parts = re.split("(`+[^`]*`+)", line)
    text = "".join(part if k % 2 else part.replace("|", r"\|") for k, part in enumerate(parts))
    return re.sub(r"((?<!`)`[^`]+`)(?=\w)", r"\1\\ ", text)


def _plain_text(app: Sphinx, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """Escape what docstrings write as text and reStructuredText reads as marks: bars of a norm, tables of Markdown."""
    changed: list[str] = []
    for line in lines:
        row = line.lstrip().startswith("|")
        if row and not (changed and changed[-1].lstrip().startswith("|")):
            changed += ["", "::", ""]
        if row:
            changed.append(f"    {line}")
            continue
        if changed and changed[-1].lstrip().startswith("|") and line.strip():
            changed.append("")
        changed.append(line if line.lstrip().startswith((">>>", "...")) else _escaped(line))
    lines[:] = changed


def _no_builtins(app: Sphinx, doctree: nodes.document) -> None:
    """Show built-in types without a link; Python's own pages are not at hand, and attributes may have their names."""
    for node in list(doctree.findall(pending_xref)):
        if node.get("refdomain") == "py" and hasattr(builtins, str(node.get("reftarget"))):
            node.replace_self(node.children)
        elif node.get("refdomain") == "py":
            node.attributes.pop("refspecific", None)  # its mere presence makes Sphinx match the ends of names


def _exists(target: str) -> bool:
    """Whether there is an object by this dotted name."""
    module, _, name = target.rpartition(".")
    try:
        return hasattr(import_module(module), name)
    except ImportError:
        return False


def _resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, words: nodes.Node) -> nodes.Node | None:
    """Link a type by its last name, since it is documented where it is exported and not where it is defined.

    A public class name has one meaning in the whole project, which a test holds. A type that no package exports is
    shown without a link, and so is what is not the project's own, because the site is built without a network.
    """
    if node.get("refdomain") != "py":
        return None
    target = str(node.get("reftarget", ""))
    last = target.rpartition(".")[2]
    objects = env.domains["py"].data["objects"]
    kinds = ("class", "exception", "function", "data")
    homes = sorted(
        (k for k, entry in objects.items() if k.rpartition(".")[2] == last and entry.objtype in kinds), key=len
    )
    if homes:
        entry = objects[homes[0]]
        uri = app.builder.get_relative_uri(node["refdoc"], entry.docname)
        return nodes.reference("", "", words, internal=True, refuri=f"{uri}#{entry.node_id}", reftitle=homes[0])
    return words if not target.startswith("wakewise") or _exists(target) else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for pages."""
    app.connect("builder-inited", _write)
    app.connect("autodoc-process-docstring", _plain_text, priority=100)
    app.connect("doctree-read", _no_builtins)
    app.connect("missing-reference", _resolve)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
