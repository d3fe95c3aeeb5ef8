"""Pages of the site that are files of the repository: links that leave docs/, pages of the root, the layer diagram.

Pages are written for readers of the repository, with relative links. Here these links are changed in what Sphinx
reads: to a page of the site where there is one, to a download where it is a file, to text where it is a folder.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from layer_diagram import layer_diagram

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).parents[1]
ROOT = DOCS.parent
OF_ROOT = {
    "project/contributing": "CONTRIBUTING.md",
    "project/changelog": "CHANGELOG.md",
    "project/security": "SECURITY.md",
}
"""Pages of the site that show a file of the root; docs/project/ holds a line for each."""
GENERATED = ("commands",)
"""Pages whose blocks are what a program prints; blocks of other pages are lines for a shell."""
FOLDERS = ("results/README", "results-pump-tank/README", "results-station/README")
"""Pages that lead to all pages of their folder."""
LOG = "research-log"
"""Folder of notes that stay out of the sidebar, where there is one for each page of the site: its README lists them."""
_OF_FOLDER = "\n\n:::{toctree}\n:hidden:\n:glob:\n\n*\n:::\n"
_LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s#]*)(#[^)\s]*)?\)")
_FENCE = re.compile(r"^[ \t]*```.*?^[ \t]*```[ \t]*$", re.MULTILINE | re.DOTALL)


def _outside_of_blocks(text: str, change: Any) -> str:
    """Apply `change` to the text between fenced blocks."""
    parts, at = [], 0
    for block in _FENCE.finditer(text):
        parts += [change(text[at : block.start()]), block.group()]
        at = block.end()
    return "".join([*parts, change(text[at:])])


def _named_blocks(text: str, language: str) -> str:
    """Give blocks that name no language this one."""
    inside, lines = False, []
    for line in text.split("\n"):
        if line.lstrip().startswith("```"):
            opens, inside = not inside, not inside
            lines.append(line + language if opens and line.strip() == "```" else line)
        else:
            lines.append(line)
    return "\n".join(lines)


def _target(found: Path, anchor: str) -> str | None:
    """Path of the page of the site that shows a file, from the root of the site; None if no page does."""
    if found == ROOT / "README.md":
        return "/index.md"
    for page, name in OF_ROOT.items():
        if found == ROOT / name:
            return f"/{page}.md{anchor}"
    if found.is_dir() and found.is_relative_to(DOCS) and (found / "README.md").is_file():
        return f"/{(found / 'README.md').relative_to(DOCS).as_posix()}"
    if found.suffix == ".md" and found.is_file() and found.is_relative_to(DOCS):
        return f"/{found.relative_to(DOCS).as_posix()}{anchor}"
    return None


def links_of_site(text: str, folder: Path, here: Path) -> str:
    """Text whose links are relative to `folder`, with links as a page in folder `here` of the site has them."""

    def change(link: re.Match[str]) -> str:
        picture, words, path, anchor = link[1], link[2], link[3], link[4] or ""
        if not path or re.match(r"\w+:", path):
            return link[0]
        found = Path(os.path.normpath(folder / path))
        if not found.exists():
            return link[0]
        if picture:
            return f"![{words}]({os.path.relpath(found, here)})"
        page = _target(found, anchor)
        if page is not None:
            return f"[{words}]({page})"
        if found.is_dir():
            return words
        plain = words.replace("`", "")
        return f"{{download}}`{plain} <{os.path.relpath(found, here)}>`"

    return _outside_of_blocks(text, lambda part: _LINK.sub(change, part))


def _read(app: Sphinx, name: str, source: list[str]) -> None:
    path = Path(app.env.doc2path(name))
    if path.suffix != ".md":
        return
    if name in OF_ROOT:
        file = ROOT / OF_ROOT[name]
        app.env.note_dependency(str(file))
        source[0] = links_of_site(file.read_text(encoding="utf-8"), ROOT, path.parent)
        return
    text = re.sub(r"^```mermaid\n(.*?)^```$", lambda m: layer_diagram(m[1]), source[0], flags=re.MULTILINE | re.DOTALL)
    text = _named_blocks(text, "text" if name in GENERATED else "bash")
    text = links_of_site(text, path.parent, path.parent) + (_OF_FOLDER if name in FOLDERS else "")
    if name == f"{LOG}/README":
        text += "\n\n" + "\n".join(f"- [{_title(note)}]({note.name})" for note in sorted(path.parent.glob("0*.md")))
    elif name.startswith(f"{LOG}/"):
        text = f"---\norphan: true\n---\n\n{text}"
    source[0] = text


def _title(page: Path) -> str:
    first = page.read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# ")
    return first.replace("[", "").replace("]", "")


def setup(app: Sphinx) -> dict[str, Any]:
    """Change pages as they are read."""
    app.connect("source-read", _read)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
