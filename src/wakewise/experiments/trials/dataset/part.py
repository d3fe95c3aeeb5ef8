"""One trial's share of a data set: files that say what was known, files that say what is true, and facts of both."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

from wakewise.core.errors import InputError
from wakewise.core.files import whole_folder
from wakewise.experiments.exports.checksums import copied, sha256_of
from wakewise.experiments.trials.dataset.columns import known_and_true
from wakewise.experiments.trials.dataset.settings import TrialSettings, figures_of, settings_of
from wakewise.experiments.trials.dataset.trial_sources import METRICS, SCENARIO, STEPS, TrialSource
from wakewise.scene.targets import read_mesh

KNOWN, TRUTH = "known", "truth"
NOTE = "part.json"
"""Written with the rest: a part that has it is whole."""
_COPIED = {
    KNOWN: {"cameras.txt": "cameras.txt", "mesh.ply": "model.ply"},
    TRUTH: {"camera.json": "camera.json", "truth.ply": "target.ply", METRICS: METRICS},
}
"""Files that are taken as they are, by their names in a trial and in the data set."""
_WATCHED = (STEPS, "images.csv", *(name for side in _COPIED.values() for name in side))
PICTURES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True, kw_only=True)
class TrialPart:
    """What was taken of a trial.

    `sums` are check sums by path in the data set, `sizes` their bytes; `columns` the names and types of each table's
    columns; `facts` what the sheet tells, `figures` what the trial measured; `lacks` what it did not have.
    """

    trial: str
    marks: dict[str, list[int]]
    sums: dict[str, str] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    columns: dict[str, dict[str, str]] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    lacks: tuple[str, ...] = ()


def part_of(name: str, source: TrialSource, folder: Path) -> tuple[TrialPart, bool]:
    """A trial's share in `folder`, made if it is not there or the trial has changed since; and whether it was made.

    Raises
    ------
    InputError
        If the trial's own files contradict each other.
    """
    done = read_part(folder)
    marks = _marks(source)
    if done is not None and done.marks == marks and done.trial == name:
        return done, False
    with whole_folder(folder) as temporary:
        part = _make(name, source, temporary, marks)
        text = json.dumps(asdict(part), allow_nan=False)
        (temporary / NOTE).write_text(text, encoding="utf-8")
    return part, True


def read_part(folder: Path) -> TrialPart | None:
    """The part that stands in a folder; None if there is none that is whole."""
    try:
        told = json.loads((folder / NOTE).read_text(encoding="utf-8"))
        return TrialPart(**told | {"lacks": tuple(told["lacks"])})
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _marks(source: TrialSource) -> dict[str, list[int]]:
    """Size and time of change of what a part is made from."""
    found = {}
    paths = [*(source.folder / name for name in _WATCHED), source.settings, source.figures]
    for name, path in ((path.name, path) for path in paths):
        if path.is_file():
            stat = path.stat()
            found[name] = [stat.st_size, stat.st_mtime_ns]
    return found


@dataclass
class _Gathered:
    """What has been written so far."""

    trial: str
    into: Path
    sums: dict[str, str] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    columns: dict[str, dict[str, str]] = field(default_factory=dict)

    def note(self, side: str, name: str, digest: str) -> None:
        """Keep check sum and size of a file that was written to a side."""
        path = f"{side}/{self.trial}/{name}"
        self.sums[path], self.sizes[path] = digest, (self.into / side / name).stat().st_size

    def copy(self, side: str, source: Path, name: str) -> None:
        """Copy a file to a side."""
        self.note(side, name, copied(source, self.into / side / name))

    def tables(self, what: str, table: pl.DataFrame, shared: tuple[str, ...]) -> None:
        """Write the known and the true columns of a table apart; a truth of nothing but NaN is none."""
        for side, columns in zip((KNOWN, TRUTH), known_and_true(table.columns, shared), strict=True):
            share = table.select(pl.lit(self.trial).alias("trial"), *columns)
            if side == TRUTH and not _says_anything(share.drop("trial", *shared)):
                continue
            file = self.into / side / f"{what}.parquet"
            share.write_parquet(file)
            self.note(side, file.name, sha256_of(file))
            self.columns[f"{side}/{what}"] = {column: str(kind) for column, kind in share.schema.items()}


def _make(name: str, source: TrialSource, into: Path, marks: dict[str, list[int]]) -> TrialPart:
    gathered = _Gathered(name, into)
    for side in (KNOWN, TRUTH):
        (into / side).mkdir()
    told, steps = settings_of(source), _steps(source.folder)
    gathered.tables("states", steps, ("time_s",))
    taken = _images(gathered, source.folder) if (source.folder / "images.csv").is_file() else 0
    lacks = [] if taken else ["photographs"]
    for side, files in _COPIED.items():
        for old, new in files.items():
            if not (source.folder / old).is_file():
                lacks.append(new)
                continue
            if old.endswith(".ply"):
                read_mesh(source.folder / old)  # one that is none is refused
            gathered.copy(side, source.folder / old, new)
    if told.text:
        scenario = into / TRUTH / SCENARIO
        scenario.write_text(told.text, encoding="utf-8")
        gathered.note(TRUTH, SCENARIO, sha256_of(scenario))
    return TrialPart(
        trial=name,
        marks=marks,
        sums=gathered.sums,
        sizes=gathered.sizes,
        columns=gathered.columns,
        facts=_facts(told, steps, taken),
        figures=figures_of(source),
        lacks=tuple(lacks),
    )


def _says_anything(table: pl.DataFrame) -> bool:
    for column in table:
        if column.dtype.is_float():
            if column.is_finite().any():
                return True
        elif column.dtype != pl.Boolean and column.null_count() < len(column):
            return True
    return False


def _steps(source: Path) -> pl.DataFrame:
    path = source / STEPS
    try:
        steps = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError):
        raise InputError(f"{path}: is no Parquet file that can be read") from None
    if "time_s" not in steps.columns or "est_x_m" not in steps.columns or not steps.height:
        raise InputError(f"{path}: holds no flight (rows with time_s and est_x_m)")
    return steps


def _images(gathered: _Gathered, source: Path) -> int:
    path = source / "images.csv"
    try:
        table = pl.read_csv(path, schema_overrides={"name": pl.String}, infer_schema_length=None)
    except (OSError, pl.exceptions.PolarsError):
        raise InputError(f"{path}: is no table that can be read") from None
    if "name" not in table.columns or "time_s" not in table.columns or table["name"].null_count():
        raise InputError(f"{path}: must hold photographs, each with name and time_s")
    names = table["name"].to_list()
    for picture in names:
        if Path(picture).name != picture or Path(picture).suffix.lower() not in PICTURES:
            raise InputError(f"{path}: '{picture}' is no name of a photograph ({', '.join(PICTURES)})")
    if len(set(names)) < len(names):
        raise InputError(f"{path}: names a photograph twice")
    (gathered.into / KNOWN / "images").mkdir()
    for picture in names:
        file = source / "images" / picture
        if not file.is_file():
            raise InputError(f"{file}: listed in images.csv but not there")
        gathered.copy(KNOWN, file, f"images/{picture}")
    # Whole numbers in one trial and fractions in the next would be two types of one column.
    numbers = [column for column in table.columns if column != "name"]
    table = table.with_columns(pl.col(numbers).cast(pl.Float64, strict=False))
    gathered.tables("images", table, ("name", "time_s"))
    return len(names)


def _facts(told: TrialSettings, steps: pl.DataFrame, photographs: int) -> dict[str, Any]:
    time, seed = steps["time_s"].cast(pl.Float64).to_numpy(), told.tree.get("seed")
    return {
        "scenario": told.word("name"),
        "vehicle": told.word("vehicle"),
        "method": told.word("method"),
        "pilot": told.word("pilot"),
        "world": told.word("world"),
        "target": told.word("target", "kind"),
        "seed": seed if isinstance(seed, int) else None,
        "simulated": "true_x_m" in steps.columns and bool(steps["true_x_m"].is_finite().any()),
        "steps": steps.height,
        "duration_s": float(time.max() - time.min()),
        "photographs": photographs,
        "thrusters": sum(re.fullmatch(r"command_\d+_N", name) is not None for name in steps.columns),
        "wakewise": told.wakewise,
    }
