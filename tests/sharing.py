"""Which process of several runs which file of the tests next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

BESIDE = (
    "benchmarks/tests/test_campaign_bench.py",
    "tests/experiments/campaigns/",
    "tests/ui/cli/test_campaign_command.py",
    "tests/ui/cli/test_computer_faults.py",
    "tests/ui/cli/test_heartbeat.py",
    "packages/wakewise-ardusub/tests/cli/test_link_meter_command.py",
    "packages/wakewise-ardusub/tests/cli/test_link_sitl_command.py",
    "packages/wakewise-ardusub/tests/cli/test_link_wire_commands.py",
    "tests/ui/cockpit/test_pictures.py",
    "tests/ui/cockpit/test_server.py",
    "packages/wakewise-ardusub/tests/link/test_ardusub_page.py",
    "packages/wakewise-ardusub/tests/sitl/test_behind_real_bytes.py",
    "packages/wakewise-ardusub/tests/sensors/",
    "packages/wakewise-ardusub/tests/wash_meter/",
    "tests/vision/reconstruction/test_colmap.py",
    "packages/wakewise-paper/tests/wash_reduction/test_gentle_bench.py",
    "tests/test_alone.py",
    "tests/test_core.py",
    "tests/experiments/trials/test_surface_maker.py",
)
"""Files and folders whose tests mostly wait, for a clock or for another process, and load few kernels themselves."""
LONGEST = "tests/experiments/trials/test_whole_trial.py"
"""Takes twice as long as any other: begun last, it would be waited for."""


def folder_of(file: str) -> str:
    """The first two folders below `tests/` that a file lies in; a file that lies in none is its own."""
    folders = file.split("/")[:-1]
    below = folders.index("tests") + 1
    return "/".join(folders[: below + 2]) if folders[below:] else file


def waits(file: str) -> bool:
    """Whether its tests mostly wait."""
    return file.startswith(BESIDE)


def next_file(left: Sequence[str], begun: Collection[str], own: str | None, waiter: bool | None) -> str | None:
    """The file to run next of those that are left, in their order; None if there is none for this process.

    A folder's kernels are loaded, and what its tests share is made, once in each process that enters it. So a process
    stays in its own folder, then enters one that nobody has begun, then helps in that with the most files left.
    `LONGEST` comes before all.

    Parameters
    ----------
    left : sequence of str
    begun : collection of str
        Folders that some process has entered.
    own : str or None
        The folder that this process is in.
    waiter : bool or None
        Whether this is the process for what mostly waits, which runs nothing else. The others then run that only
        when nothing else is left; None if there is no such process, and files are alike.
    """
    if waiter:
        return next((file for file in left if waits(file)), None)
    files = left if waiter is None else [file for file in left if not waits(file)] or left
    if LONGEST in files:
        return LONGEST
    for file in files:
        if folder_of(file) == own:
            return file
    for file in files:
        if folder_of(file) not in begun:
            return file
    if not files:
        return None
    ((fullest, _),) = Counter(map(folder_of, files)).most_common(1)
    return next(file for file in reversed(files) if folder_of(file) == fullest)
