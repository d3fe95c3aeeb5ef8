"""What only a person can say of a data set: its licence, its creators, its name and where it will be."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, read_yaml

LICENCES = (
    "CC0-1.0", "CC-BY-4.0", "CC-BY-SA-4.0", "CC-BY-NC-4.0", "CC-BY-NC-SA-4.0", "CC-BY-ND-4.0", "ODbL-1.0", "ODC-By-1.0",
    "PDDL-1.0", "CDLA-Permissive-2.0", "CDLA-Sharing-1.0", "MIT", "Apache-2.0",
)  # fmt: skip
"""Licences for data that are known by their SPDX names (https://spdx.org/licenses/); others by their address."""
QUESTIONS = ("purpose", "funding", "period", "ethics", "maintenance")
"""What a data sheet asks that cannot be counted: why it was made, who paid, over what time, under which review, who
answers for it."""
_ADDRESS = re.compile(r"https?://[^\s/]+(/\S*)?\Z")
_VERSION = re.compile(r"\d+\.\d+\.\d+\Z")


@dataclass(frozen=True, kw_only=True)
class DatasetStatement:
    """Licence as an address, and the rest as it was given."""

    name: str
    licence: str
    creators: tuple[str, ...]
    url: str
    published: str
    version: str
    answers: Mapping[str, str] = field(default_factory=dict)

    @property
    def citation(self) -> str:
        """How the data set is cited, in BibTeX; a creator's name stands in braces, so that none is taken apart."""
        key = "".join(letter for letter in self.name if letter.isalnum()) or "dataset"
        year = self.published[:4]
        where = "" if self.url == "./" else f", url = {{{self.url}}}"
        authors = " and ".join(f"{{{name}}}" for name in self.creators)
        return (
            f"@misc{{{key}{year}, title = {{{self.name}}}, author = {{{authors}}}, year = {{{year}}}, "
            f"version = {{{self.version}}}{where}}}"
        )


def read_words(
    *,
    name: str,
    licence: str | None,
    creators: Sequence[str],
    url: str | None = None,
    published: str | None = None,
    version: str = "1.0.0",
    answers: Path | None = None,
) -> DatasetStatement:
    """Check what was said.

    `licence` is one of `LICENCES` or the address of another; `url` is where the data set will be ("./", its own folder,
    until that is known); `published` is an ISO date, today's if not given; `version` is MAJOR.MINOR.PATCH; `answers` is
    a YAML file with answers to some of `QUESTIONS`.

    Raises InputError if a word is missing or is none.
    """
    if not licence:
        raise InputError(f"--license: missing; data without one may not be used: {', '.join(LICENCES)}, or an address")
    known = {word.lower().replace(" ", "-"): word for word in LICENCES}
    spdx = known.get(licence.strip().lower().replace(" ", "-"))
    if spdx is None and not _ADDRESS.match(licence):
        raise InputError(f"--license: '{licence}', allowed are {', '.join(LICENCES)}, or an address (https://...)")
    told = tuple(word.strip() for word in creators if word.strip())
    if not told:
        raise InputError("--creator: missing; who made the data, a person or an institution (may be repeated)")
    if not name.strip():
        raise InputError("--name: is empty")
    if url is not None and not _ADDRESS.match(url):
        raise InputError(f"--url: '{url}', must be an address (https://...)")
    if not _VERSION.match(version):
        raise InputError(f"--version: '{version}', must be MAJOR.MINOR.PATCH, such as 1.0.0")
    if published is not None:
        try:
            datetime.date.fromisoformat(published)
        except ValueError:
            raise InputError(f"--date: '{published}', must be YYYY-MM-DD") from None
    return DatasetStatement(
        name=name.strip(),
        licence=f"https://spdx.org/licenses/{spdx}.html" if spdx else licence,
        creators=told,
        url=url or "./",
        published=published or datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        version=version,
        answers={} if answers is None else _answers(answers),
    )


def _answers(path: Path) -> dict[str, str]:
    try:
        told = read_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(f"--answers {path}: cannot be read, {fault}") from None
    except YamlError as fault:
        raise InputError(f"--answers {path}: {fault}") from None
    if not isinstance(told, dict):
        raise InputError(f"--answers {path}: must hold lines such as 'purpose: why it was made'")
    for question, answer in told.items():
        if question not in QUESTIONS:
            raise InputError(f"--answers {path}: '{question}' is not asked, allowed are {', '.join(QUESTIONS)}")
        if not isinstance(answer, str) or not answer.strip():
            raise InputError(f"--answers {path}: {question} must be words")
    return {question: " ".join(answer.split()) for question, answer in told.items()}
