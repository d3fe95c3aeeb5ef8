"""One trial's share of a data set: files that say what was known, files that say what is true, and facts of both.

Which columns of a trial a controller could know, and what each column means.

What is known is listed; everything else is truth, so that a column that is added one day does not slip into what may be
learnt from.

Which folders are trials, and where each keeps its flight, its settings and its figures.

What a trial was set to and what was measured of it, from the files of a trial or of a campaign.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import polars as pl
import yaml

from wakewise.core.errors import InputError
from wakewise.core.files import sha256_of, whole_folder
from wakewise.core.safe_yaml import YamlError, read_yaml
from wakewise.experiments.trials.dataset.checksums import copied
from wakewise.scene.targets import read_mesh

_KNOWN = re.compile(
    r"time_s|exposing|fallback|leg|disturbance|name|sharpness|(est|goal|wrench|load)_\w+|command_\d+_N|ardusub_\w+"
)
_WHOSE = {"true": "true", "est": "estimated", "goal": "desired"}
_STATE = {
    "x_m": "north of the body's origin, m", "y_m": "east of the body's origin, m", "z_m": "its depth, m",
    "qw": "attitude quaternion from body to world, w", "qx": "the same, x", "qy": "the same, y", "qz": "the same, z",
    "u_m_s": "velocity forward, m/s", "v_m_s": "velocity to the right, m/s", "w_m_s": "velocity down, m/s",
    "p_rad_s": "turning about the axis forward, rad/s", "q_rad_s": "turning about the axis to the right, rad/s",
    "r_rad_s": "turning about the axis down, rad/s", "tilt_deg": "angle of the camera's joint, up, deg",
}  # fmt: skip
_CAMERA = {
    "x_m": "north of the camera's centre, m", "y_m": "east of the camera's centre, m", "z_m": "its depth, m",
    "qw": "quaternion from camera (x right, y down, z ahead) to world, w",
}  # fmt: skip
_AXES = {
    "X_N": "force forward, N", "Y_N": "force to the right, N", "Z_N": "force down, N",
    "K_Nm": "moment about the axis forward, N m", "M_Nm": "moment about the axis to the right, N m",
    "N_Nm": "moment about the axis down, N m",
}  # fmt: skip
_SINGLE = {
    "trial": "which trial the row is of",
    "time_s": "seconds since the trial's start",
    "exposing": "whether a photograph is taken in this step",
    "collision": "whether the hull touches something",
    "fallback": "why what was sent is not what the method wanted; empty if it is",
    "leg": "what stretch of the mission this is",
    "disturbance": "D by the controller's own wake model, (m/s)^2",
    "power_W": "electrical power of all thrusters, W",
    "name": "file name of the photograph",
    "sharpness": "of the photograph, without unit",
    "turbidity_per_m": "mean beam attenuation by silt near the target, 1/m",
    "target_speed_mean_m_s": "water speed on the target in excess of the same water without the vehicle, mean, m/s",
    "target_speed_p95_m_s": "the same, 95th percentile, m/s",
    "bed_speed_p95_m_s": "the same 1 to 2 cm above the bed round its foot, 95th percentile, m/s",
}


def is_known(column: str) -> bool:
    """Whether a controller or a crew could have had it."""
    return _KNOWN.fullmatch(column) is not None


def known_and_true(columns: Iterable[str], shared: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """Columns of both sides, in their order; the `shared` ones, which join the two, stand on both."""
    names = list(columns)
    known = [name for name in names if is_known(name)]
    return known, [name for name in names if not is_known(name) or name in shared]


def meaning(column: str, of_camera: bool = False) -> str:
    """What a column is, with its unit; world north-east-down, body forward-right-down."""
    if column in _SINGLE:
        return _SINGLE[column]
    head, _, rest = column.partition("_")
    table = _STATE | _CAMERA if of_camera else _STATE
    if head in _WHOSE and rest in table:
        return f"{_WHOSE[head]}: {table[rest]}"
    if head in ("wrench", "load") and rest in _AXES:
        return f"{'asked of the thrusters' if head == 'wrench' else 'unexplained load, estimated'}: {_AXES[rest]}"
    match = re.fullmatch(r"(thrust|command)_(\d+)_N", column)
    if match is not None:
        return f"thruster {match[2]}: {'thrust it gave' if match[1] == 'thrust' else 'thrust it was sent'}, N"
    return f"{column.replace('_', ' ')}; see the data sheet"


STEPS, SCENARIO, METRICS = "steps.parquet", "scenario.yaml", "metrics.json"
TASK, FIGURES = "trial.json", "figures.json"
"""What a campaign keeps of each of its trials: what is made, and, once it is finished, its figures."""
_WORK = ("work/trial", "work")
"""Where a campaign's work leaves its flight: a whole trial, or a flight alone."""


@dataclass(frozen=True)
class TrialSource:
    """A trial: the folder of its flight; settings and figures, which a campaign keeps elsewhere.

    `settings` is a scenario (YAML) or a campaign's task (JSON); files may not be there.
    """

    folder: Path
    settings: Path
    figures: Path


def source_in(folder: Path) -> TrialSource | None:
    """The trial in a folder, its own or a campaign's; None where none was flown to its end."""
    if (folder / STEPS).is_file():
        return TrialSource(folder, folder / SCENARIO, folder / METRICS)
    if (folder / TASK).is_file() and (folder / FIGURES).is_file():
        for work in _WORK:
            flown = folder / work
            if (flown / STEPS).is_file():
                settings, figures = flown / SCENARIO, flown / METRICS
                return TrialSource(
                    flown,
                    settings if settings.is_file() else folder / TASK,
                    figures if figures.is_file() else folder / FIGURES,
                )
    return None


def trials_of(folder: Path) -> tuple[dict[str, TrialSource], list[str]]:
    """Trials by name, and names of folders that hold one that was not flown to its end.

    A trial's own folder is one trial; a campaign's holds them below trials/; else every folder in it that is a trial,
    and those one further down, whose names are then joined.

    Raises InputError if there is none.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give that of a campaign, of trials, or of one trial")
    alone = source_in(folder)
    if alone is not None:
        return {_name(folder.resolve().name): alone}, []
    top = folder / "trials" if (folder / "trials").is_dir() else folder
    found: dict[str, TrialSource] = {}
    unfinished: list[str] = []
    for path in _folders(top):
        inner = [path] if _is_trial(path) else [deep for deep in _folders(path) if _is_trial(deep)]
        for trial in inner:
            name = _name("-".join(trial.relative_to(top).parts))
            source = source_in(trial)
            if source is None:
                unfinished.append(name)
            elif name in found:
                raise InputError(f"{trial}: a trial of the name {name} is there already; rename one of them")
            else:
                found[name] = source
    if not found:
        more = f", {len(unfinished)} not flown to their end" if unfinished else ""
        raise InputError(f"{folder}: holds no trial (a folder with {STEPS}){more}")
    return found, unfinished


def _folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def _is_trial(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (STEPS, SCENARIO, TASK))


def _name(text: str) -> str:
    """A name that every file system and every glob pattern takes as it is."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", text).strip(".") or "trial"


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """A scenario as a tree and as text; nothing where a trial has none.

    Names of folders are taken out of the text: they are private and exist on one computer only.
    """

    tree: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""
    wakewise: str | None = None

    def word(self, *path: str) -> str | None:
        """A name in the tree as it may be published: of a path the last part; None where there is none."""
        value: Any = self.tree
        for name in path:
            value = value.get(name) if isinstance(value, Mapping) else None
        return Path(value).name if isinstance(value, str) else None


def settings_of(source: TrialSource) -> TrialSettings:
    """Settings of a trial.

    Raises InputError if their file is there and cannot be read.
    """
    path = source.settings
    if not path.is_file():
        return TrialSettings()
    if path.suffix == ".json":
        told = _json(path).get("settings")
        tree = told.get("scenario") if isinstance(told, dict) else None
        if not isinstance(tree, dict):
            return TrialSettings()
        return TrialSettings(tree=tree, text=_without_folders(yaml.safe_dump(tree, sort_keys=False)))
    try:
        text = path.read_text(encoding="utf-8")
        tree = read_yaml(text)
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text in UTF-8") from None
    except YamlError as fault:
        raise InputError(f"{path}: {fault}") from None
    version = re.search(r"^# wakewise (\S+)$", text, flags=re.M)
    return TrialSettings(
        tree=tree if isinstance(tree, dict) else {},
        text=_without_folders(text),
        wakewise=version[1] if version else None,
    )


def figures_of(source: TrialSource) -> dict[str, float]:
    """What was measured of a trial, as far as it is numbers.

    Raises InputError if their file is there and cannot be read.
    """
    if not source.figures.is_file():
        return {}
    told = _json(source.figures)
    inner = told.get("figures")
    told = inner if isinstance(inner, dict) else told
    numbers = {key: value for key, value in told.items() if isinstance(value, int | float) and key != "seed"}
    return {key: float(value) for key, value in numbers.items() if math.isfinite(value)}


def _json(path: Path) -> dict[str, Any]:
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError):
        raise InputError(f"{path}: is no JSON that can be read") from None
    return told if isinstance(told, dict) else {}


def _without_folders(text: str) -> str:
    return re.sub(r"(?m)(:\s+['\"]?)(?:/|[A-Za-z]:[\\/])[^\n'\"]*[/\\]([^/\\\n'\"]+)", r"\1\2", text)


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
    columns; `facts` what the sheet states, `figures` what the trial measured; `lacks` what it did not have.
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

    Raises InputError if the trial's own files contradict each other.
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
