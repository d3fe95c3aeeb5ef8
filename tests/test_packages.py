"""Every package says what is in it, its pages are true, and each public class name has one meaning."""

import ast
import re
import tomllib
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = (ROOT / "src", *sorted(ROOT.glob("packages/*/src")), ROOT / "benchmarks")
PACKAGES = sorted(page.parent for source in SOURCES for page in source.glob("wakewise*/**/__init__.py"))
MODULES = sorted(path for source in SOURCES for path in source.glob("wakewise*/**/*.py"))
MAX_LINES = 600


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_the_page_of_a_package_names_only_files_that_are_there(package: Path) -> None:
    """The module docstring of a package exists, and each file that it names exists."""
    text = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8")))
    assert text, f"{package}: __init__.py has no docstring"
    for name in re.findall(r"`([\w*/]+(?:\.py|/))`", text):
        assert list(package.rglob(name.rstrip("/"))), f"{package.name}: {name} is not there"


def test_no_module_is_longer_than_600_lines() -> None:
    """A module is one concept."""
    lines = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert {name: count for name, count in lines.items() if count > MAX_LINES} == {}


def test_a_public_class_name_has_one_meaning() -> None:
    """No two modules of the project define a public class of the same name."""
    homes = defaultdict(list)
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(str(path.relative_to(ROOT)))
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}


def test_the_library_does_not_grow() -> None:
    """At most 441 modules and 85,767 lines, 6,850 for finding, mapping and tracking the target and for patches,
    1,720 for measuring models, 1,475 for picking photographs along a dive, 960 for environments for learning, and 228
    for faults that first readers found: surfaces that leave points out, files that would be replaced, parts without a
    name. The goal without these is 80,000; the bound is what is reached, and only ever lowered.
    """
    library = [path for path in MODULES if path.is_relative_to(ROOT / "src")]
    assert len([path for path in library if path.name != "__init__.py"]) <= 441
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in library)
    assert lines <= 85_767 + 6_850 + 1_720 + 1_475 + 960 + 228


def test_every_distribution_holds_a_readme_and_the_licence_and_names_the_same_authors() -> None:
    """Each project has its page and a copy of the one licence; all files that name authors name the same."""
    projects = [ROOT, *sorted(page.parent for page in ROOT.glob("packages/*/pyproject.toml")), ROOT / "benchmarks"]
    authors = set()
    for folder in projects:
        project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        assert (project["readme"], project["license-files"]) == ("README.md", ["LICENSE"]), folder
        assert project["name"] in (folder / "README.md").read_text(encoding="utf-8").lower()
        assert (folder / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes(), folder
        authors |= {author["name"] for author in project["authors"]}
    (author,) = authors
    ardusub = ROOT / "packages" / "wakewise-ardusub"
    for path, named in (
        (ROOT / "CITATION.cff", f"  - name: {author}\n"),
        (ROOT / "docs" / "conf.py", f'author = "{author}"'),
        (ardusub / "ros2" / "wakewise_ros" / "package.xml", f">{author}</maintainer>"),
        (ardusub / "extensions" / "blueos" / "Dockerfile", f'"name": "{author}"'),
    ):
        assert named in path.read_text(encoding="utf-8"), path


def test_few_lines_are_excused_from_ruff_and_mypy() -> None:
    """At most eight lines carry a comment that silences ruff or mypy; the bound is only ever lowered."""
    folders = ("src", "packages", "benchmarks", "tools", "tests", "examples")
    paths = [ROOT / "conftest.py", *(path for folder in folders for path in (ROOT / folder).rglob("*.py"))]
    excused = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in paths
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"#\s*(noqa|type:\s*ignore)\b", line)
    ]
    assert len(excused) <= 8, excused
