"""Design records, glossary and style guide: their form, their links, and the modules that they name."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
RECORDS = sorted((DOCS / "decisions").glob("*.md"))
SECTIONS = ["Status", "Context", "Decision", "Consequences", "Evidence"]
PACKAGES = [DOCS.parent / "src", *DOCS.parent.glob("packages/*/src"), DOCS.parent / "benchmarks"]


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.stem)
def test_a_design_record_has_its_sections_and_at_most_40_lines(record: Path) -> None:
    """Status, Context, Decision, Consequences and Evidence, in this order, in at most 40 lines, numbered as its
    file.
    """
    lines = record.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 40
    assert [line[3:] for line in lines if line.startswith("## ")] == SECTIONS
    assert lines[0].startswith(f"# {int(record.name[:2])}. ")


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.stem)
def test_the_evidence_of_a_design_record_is_in_the_research_log(record: Path) -> None:
    """The section of evidence links at least one note, each by the number that its file has."""
    evidence = record.read_text(encoding="utf-8").split("## Evidence")[1]
    notes = re.findall(r"\[(\d+)\]\(\.\./research-log/(\d+)-", evidence)
    assert notes
    assert [(shown, number) for shown, number in notes if int(shown) != int(number)] == []


@pytest.mark.parametrize(
    "page",
    [*RECORDS, *(DOCS / name for name in ("glossary.md", "style.md", "validation.md", "research-log/README.md"))],
    ids=lambda page: page.stem,
)
def test_relative_links_name_files(page: Path) -> None:
    """Every relative link of these pages leads to a file or folder."""
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if not link.startswith("http") and not (page.parent / link).exists()] == []


def _terms() -> list[list[str]]:
    rows = [line for line in (DOCS / "glossary.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[1:]]


def test_the_glossary_is_alphabetical() -> None:
    """Each term stands once, in alphabetical order."""
    terms = [row[0].lower() for row in _terms()]
    assert terms == sorted(set(terms))


def test_the_modules_of_the_glossary_exist() -> None:
    """Every module in its last column is a module or package of the repository."""
    named = [name for row in _terms() for name in re.findall(r"`(wakewise[\w.]*)`", row[3])]
    paths = [Path(*name.split(".")) for name in named]
    missing = [
        str(path)
        for path in paths
        if not any((root / path).with_suffix(".py").exists() or (root / path).is_dir() for root in PACKAGES)
    ]
    assert len(named) > 60
    assert missing == []
