"""Print for each page its words, its longest sentence and its Flesch-Kincaid grade; exit 1 where a bound is passed.

Bounds: README at most grade 9; a page at most 1,500 words; a sentence at most 30 words. Tables, code, formulas
and headings are no sentences; the words of tables count as words of the page. Pages of EXCEPTIONS are looked up in, not
read. `--strict`, as `make docs` calls it, makes what is passed an error.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXCEPTIONS = {
    "docs/commands.md": "generated",
    "docs/scenario.md": "generated",
    "docs/vehicle-file.md": "generated",
    "docs/architecture.md": "generated",
    "docs/names.md": "a table of names",
    "docs/glossary.md": "a table of terms",
    "docs/truth.md": "a table of laws",
    "docs/validation.md": "a table of laws, generated in part",
}
MOST_WORDS, MOST_IN_SENTENCE, MOST_GRADE = 1500, 30, 9.0


@dataclass(frozen=True)
class PageFigures:
    """Words of a page, its longest sentence in words and as text, and its grade."""

    words: int
    longest: int
    sentence: str
    long_ones: int
    grade: float


def _plain(text: str) -> str:
    """Text without marks: links are their words, code is its text."""
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"\$[^$]+\$", "x", text)
    # Code is one word, whatever it holds: a path is not read by syllables.
    text = re.sub(r"`[^`]+`", "code", text)
    return re.sub(r"[*_>]", "", text)


def paragraphs(page: str) -> tuple[list[str], list[str]]:
    """Paragraphs of prose, items of lists apart, and rows of tables."""
    page = re.sub(r"^[ \t]*(```|:::+).*?^[ \t]*\1[ \t]*$", "", page, flags=re.MULTILINE | re.DOTALL)
    page = re.sub(r"\$\$.*?\$\$", "", page, flags=re.DOTALL)
    page = re.sub(r"<!--.*?-->", "", page, flags=re.DOTALL)
    prose: list[str] = []
    rows: list[str] = []
    held: list[str] = []
    for line in [*page.splitlines(), ""]:
        item = re.match(r"\s*(?:[-*]|\d+\.)\s+", line)
        if line.startswith("|"):
            rows.append(line)
        if not line.strip() or line.startswith(("#", "|")) or item:
            if held:
                prose.append(" ".join(held))
            held = [line[item.end() :]] if item else []
        else:
            held.append(line.strip())
    if held:
        prose.append(" ".join(held))
    return prose, rows


def _words(text: str) -> list[str]:
    return re.findall(r"[A-Za-z0-9][\w'’.,/%-]*", text)


def _syllables(word: str) -> int:
    """Groups of vowels, without a silent e; a number is one."""
    letters = re.sub(r"[^a-z]", "", word.lower())
    if not letters:
        return 1
    groups = len(re.findall(r"[aeiouy]+", letters))
    if letters.endswith("e") and not letters.endswith(("le", "ee")):
        groups -= 1
    return max(1, groups)


def figures_of(page: str) -> PageFigures:
    """Figures of a page's text."""
    prose, rows = paragraphs(page)
    sentences = [
        part
        for paragraph in prose
        for part in re.split(r"(?<=[.!?:;])\s+(?=[A-Z`(\[\d*])|(?<=[.!?])\s+", _plain(paragraph))
        if _words(part)
    ]
    counts = [len(_words(sentence)) for sentence in sentences]
    words = [word for sentence in sentences for word in _words(sentence)]
    syllables = sum(_syllables(word) for word in words)
    grade = 0.39 * len(words) / max(1, len(sentences)) + 11.8 * syllables / max(1, len(words)) - 15.59
    in_tables = sum(len(_words(_plain(row))) for row in rows)
    longest = max(range(len(counts)), key=counts.__getitem__, default=None)
    return PageFigures(
        words=len(words) + in_tables,
        longest=0 if longest is None else counts[longest],
        sentence="" if longest is None else sentences[longest],
        long_ones=sum(count > MOST_IN_SENTENCE for count in counts),
        grade=grade if words else 0.0,
    )


def pages() -> list[Path]:
    """README, CONTRIBUTING and docs/*.md."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def main() -> int:
    """Print the table and what passes a bound."""
    passed = []
    print(f"{'page':<28} {'words':>6} {'longest':>8} {'over 30':>8} {'grade':>6}")
    for path in pages():
        name = str(path.relative_to(ROOT))
        found = figures_of(path.read_text(encoding="utf-8"))
        note = f"  {EXCEPTIONS[name]}" if name in EXCEPTIONS else ""
        print(f"{name:<28} {found.words:>6} {found.longest:>8} {found.long_ones:>8} {found.grade:>6.1f}{note}")
        if name == "README.md" and found.grade > MOST_GRADE:
            passed.append(f"{name}: grade {found.grade:.1f}, at most {MOST_GRADE:g}")
        if name not in EXCEPTIONS and found.words > MOST_WORDS:
            passed.append(f"{name}: {found.words} words, at most {MOST_WORDS}")
        if name not in EXCEPTIONS and found.longest > MOST_IN_SENTENCE:
            passed.append(
                f"{name}: {found.long_ones} sentences over {MOST_IN_SENTENCE} words: {found.sentence[:90]}..."
            )
    print("\n".join(passed) or "all pages are within the bounds")
    return 1 if passed and "--strict" in sys.argv[1:] else 0


if __name__ == "__main__":
    sys.exit(main())
