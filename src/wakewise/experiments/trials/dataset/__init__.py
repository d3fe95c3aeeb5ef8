"""A data set of trials: what a crew could know and what is true, apart, with metadata, check sums and a data sheet.

Start reading in `build.py` (a folder of trials becomes a data set, and can go on where it was cut off).
`part.py` finds the trials, `part.py` reads what they were set to, `part.py` makes one trial's share,
`part.py` says which column is known and which is truth and what each means. `statement.py` takes licence, creators
and name, `metadata.py` writes Croissant, `build.py` the data sheet from `sheet.md`; `metadata.py` says whether a data
set is still what it was.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.experiments.trials.dataset.build import DatasetBuildResult, build_dataset
    from wakewise.experiments.trials.dataset.metadata import ChecksumReport, check_dataset
    from wakewise.experiments.trials.dataset.statement import read_words

__all__ = ["ChecksumReport", "DatasetBuildResult", "build_dataset", "check_dataset", "read_words"]

lazy_attributes(__name__)
