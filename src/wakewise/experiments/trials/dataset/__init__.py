"""Data sets of trials: what is known in the field and what is true, apart, with metadata, check sums and a data sheet.

- `build.py`: a folder of trials becomes a data set, and goes on where it was cut off; the data sheet from `sheet.md`.
- `part.py`: which folders are trials, one trial's share of a data set, which columns are known and what each means.
- `statement.py`: licence, creators, name and answers, as given.
- `metadata.py`: Croissant metadata from the template `croissant.json`; whether a data set is still what it was.
- `checksums.py`: SHA256SUMS and `croissant.json.sha256`.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.experiments.trials.dataset.build import DatasetBuildResult, build_dataset
    from wakewise.experiments.trials.dataset.metadata import ChecksumReport, check_dataset
    from wakewise.experiments.trials.dataset.statement import read_words

__all__ = ["ChecksumReport", "DatasetBuildResult", "build_dataset", "check_dataset", "read_words"]

lazy_attributes(__name__)
