"""Every file of a result is written whole or not at all: no line of the package writes to a file's final name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = (ROOT / "src", *sorted(ROOT.glob("packages/*/src")), ROOT / "benchmarks")
# By name, whoever's they are: methods and functions that write to the place that they are given.
WRITERS = {
    *("write_parquet", "write_csv", "write_ipc", "write_ndjson", "sink_parquet", "sink_csv"),
    *("save", "savez", "savez_compressed", "savetxt", "tofile", "memmap", "open_memmap"),
    *("imwrite", "imsave", "savefig", "VideoWriter", "export", "open_mcap"),
    *("write_text", "write_bytes", "touch", "to_csv", "to_parquet", "dump"),
    *("copy", "copy2", "copyfile", "copyfileobj", "copytree", "Writer", "FileHandler"),
}
OPENERS = ("open", "ZipFile", "TarFile", "GzipFile")
CALLED = re.compile(rf"\b({'|'.join((*sorted(WRITERS), *OPENERS))})\s*\(")
"""Stands in every file that holds a write."""
_GUARDS = {"whole_file", "whole_folder", "TemporaryDirectory", "database_folder"}
# Whole by other means, or no result. A line here needs a reason that is true of every write of that function.
ALLOWED = dict.fromkeys(
    (
        "wakewise.experiments.campaigns.attempt_log._add",
        "wakewise.ui.cli.reconstruct.RunLog.say",
        "wakewise_ardusub.session.cameras.note_view",
    ),
    "lines are only ever added, and half a line is passed over",
)
ALLOWED |= dict.fromkeys(
    (
        "wakewise_ardusub.link.session_log.SessionLog.__init__",
        "wakewise_ardusub.wash_meter.meter.DiveRecord.__init__",
        "wakewise.experiments.campaigns.worker._logged",
    ),
    "a log that grows while something runs",
)
ALLOWED |= dict.fromkeys(
    (
        "wakewise.experiments.campaigns.trial_lock._one_at_a_time",
        "wakewise.core.jit.kernel_cache._alone",
        "wakewise.core.run_lock._take",
    ),
    "a lock, which holds no result",
)
ALLOWED |= dict.fromkeys(
    ("wakewise.experiments.campaigns.trial_lock.acquire_lock", "wakewise.core.jit.precompile._take_note"),
    "gets its name by a link or by renaming, when it is whole",
)
ALLOWED |= {
    "wakewise.experiments.campaigns.run._driver_file": "says that a process is there; half of one is passed over"
}
ALLOWED |= dict.fromkeys(
    (
        "wakewise.ui.film.encode._VP9.__init__",
        "wakewise.ui.film.encode._H264.__init__",
        "wakewise.ui.film.encode._WebP.close",
    ),
    "is given the temporary name of `film_writer`, which is in a block of `whole_file`",
)
ALLOWED |= {
    "wakewise_benchmarks.large_photos.render": "photographs of a temporary folder of the bench",
    "wakewise_benchmarks.peak_memory.forget_peak": "a file of the kernel, which takes a command and keeps nothing",
}
ALLOWED |= {
    "wakewise_paper.lattice_reference.mean_field.compute_run": "`LatticeRun.save` writes in a block of `whole_file`"
}
ALLOWED |= dict.fromkeys(
    (
        *(
            "wakewise.experiments.exports.colmap.write_colmap",
            "wakewise.experiments.exports.colmap._write_binary",
            "wakewise.experiments.exports.colmap._write_text",
        ),
        *("wakewise.experiments.exports.colmap.write_nerfstudio", "wakewise.experiments.exports.colmap._write_ply"),
        *("wakewise.experiments.exports.rosbag2.write_bag", "wakewise.experiments.trials.dataset.checksums.copied"),
        *(
            "wakewise.experiments.trials.dataset.part._Gathered.tables",
            "wakewise.experiments.trials.dataset.part._make",
            "wakewise.experiments.exports.training_data.undistorted",
            "wakewise.experiments.exports.training_data.place_picture",
            "wakewise.vision.reconstruction.photos.video_frames.write_frames",
            "wakewise.vision.photo_selection.pick.write_picked",
        ),
    ),
    "writes into a folder of `whole_folder`, which its caller makes",
)
ALLOWED |= dict.fromkeys(
    (
        *(
            "wakewise.vision.reconstruction.dense.dense_points.DepthStore.add",
            "wakewise.vision.reconstruction.photos.masks.write_for_colmap",
        ),
        "wakewise.vision.reconstruction.sfm.per_photo_intrinsics.fit_per_photo_intrinsics",
        "wakewise_benchmarks.truth_photos._photos",
    ),
    "writes into a temporary folder, which its caller makes",
)


def writes(tree: ast.Module) -> Iterator[tuple[str, int, str]]:
    """Function, line and words of each call that writes outside a block of `whole_file` and the like."""
    yield from _found(tree, "", False, frozenset())


def _found(node: ast.AST, where: str, guarded: bool, buffers: frozenset[str]) -> Iterator[tuple[str, int, str]]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        where = f"{where}.{node.name}" if where else node.name
        buffers = frozenset(_buffers(node))
        guarded = guarded and not isinstance(node, ast.ClassDef)
    if isinstance(node, ast.With) and any(_name(item.context_expr) in _GUARDS for item in node.items):
        guarded = True
    if isinstance(node, ast.Call) and not guarded and _writes(node, buffers):
        yield where, node.lineno, ast.unparse(node)[:80]
    for child in ast.iter_child_nodes(node):
        yield from _found(child, where, guarded, buffers)


def _buffers(function: ast.AST) -> Iterator[str]:
    """Names of files in memory."""
    for node in ast.walk(function):
        if isinstance(node, ast.Assign) and _name(node.value) in ("BytesIO", "StringIO"):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))


def _name(node: ast.AST) -> str:
    """What is called, without whose it is."""
    if not isinstance(node, ast.Call):
        return ""
    called = node.func
    return called.attr if isinstance(called, ast.Attribute) else called.id if isinstance(called, ast.Name) else ""


def _writes(call: ast.Call, buffers: frozenset[str]) -> bool:
    name = _name(call)
    method = isinstance(call.func, ast.Attribute)
    if name in OPENERS:
        return _opens_to_write(call)
    if name not in WRITERS or (not method and name in ("write_text", "write_bytes", "copy", "dump", "export", "save")):
        return False  # those of `wakewise.core.files`, and of a module's own
    if method and isinstance(call.func, ast.Attribute):
        owner = ast.unparse(call.func.value)
        if name in ("copy", "dump") and owner not in ("shutil", "json", "yaml", "pickle"):
            return False  # of an array, a set, a mapping
        if name == "dump" and not _target(call, 1):
            return False
    if name in ("write_csv", "export", "save") and not call.args and not any(k.arg == "path" for k in call.keywords):
        return False  # gives text or bytes
    first = call.args[0] if call.args else None
    return not (isinstance(first, ast.Name) and first.id in buffers)


def _target(call: ast.Call, place: int) -> bool:
    return len(call.args) > place or any(keyword.arg in ("stream", "fp", "file") for keyword in call.keywords)


def _opens_to_write(call: ast.Call) -> bool:
    """Whether an `open`, of whatever, has a mode that writes, or `os.open` a flag that does."""
    if call.args and ast.unparse(call.args[0]) == "os.devnull":
        return False
    if isinstance(call.func, ast.Attribute) and ast.unparse(call.func.value) == "os":
        return any(flag in ast.unparse(call) for flag in ("O_CREAT", "O_WRONLY", "O_APPEND", "O_TRUNC"))
    given = [*call.args, *(keyword.value for keyword in call.keywords if keyword.arg == "mode")]
    modes = [node.value for node in given if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return any(len(mode) <= 3 and set(mode) <= set("rwaxbt+") and set(mode) & set("wax+") for mode in modes)


def _everywhere() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for source in SOURCES:
        for path in sorted(source.glob("wakewise*/**/*.py")):
            text = path.read_text(encoding="utf-8")
            if not CALLED.search(text):
                continue
            module = ".".join(part for part in path.relative_to(source).with_suffix("").parts if part != "__init__")
            for where, line, words in writes(ast.parse(text)):
                found.setdefault(f"{module}.{where}", []).append(f"{path.relative_to(ROOT)}:{line}: {words}")
    return found


def test_no_result_is_written_under_its_final_name() -> None:
    """Each write is in a block of `whole_file`, `whole_folder` or a temporary folder, or is known with its reason."""
    found = _everywhere()
    unknown = [line for key, lines in found.items() if key not in ALLOWED for line in lines]
    assert not unknown, "write through wakewise.core.files:\n" + "\n".join(unknown)
    assert not set(ALLOWED) - set(found), "reasons for what is there no more"
    assert all(len(reason.split()) > 2 for reason in ALLOWED.values())


@pytest.mark.parametrize(
    ("line", "is_found"),
    [
        ("table.write_parquet(folder / 'steps.parquet')", True),
        ("np.savez(path, a=1)", True),
        ("cv2.imwrite(str(path), image)", True),
        ("path.open('w')", True),
        ("open(path, mode='ab')", True),
        ("os.open(path, os.O_CREAT | os.O_WRONLY)", True),
        ("json.dump(value, file)", True),
        ("shutil.copyfile(a, b)", True),
        ("path.write_text('x')", True),
        ("write_text(path, 'x')", False),
        ("zipfile.ZipFile(path, 'w')", True),
        ("zipfile.ZipFile(path)", False),
        ("path.open('rb')", False),
        ("values.copy()", False),
        ("text = table.write_csv()", False),
        ("file = io.BytesIO(); np.savez(file, a=1)", False),
        ("with whole_file(path) as p: table.write_parquet(p)", False),
        ("with whole_file(path) as p, p.open('wb') as file: np.savez(file)", False),
    ],
)
def test_the_search_sees_what_it_is_to_see(line: str, is_found: bool) -> None:
    """Writes of each kind are found, and what only reads, or writes whole, is not."""
    assert bool(list(writes(ast.parse(f"def work():\n    {line}\n")))) is is_found
