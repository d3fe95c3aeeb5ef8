"""`wakewise compile`: compile all kernels once, so that no command has to."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from wakewise.ui.cli.console import ProgressBars, answer
from wakewise.ui.cli.options import Json


def warm(
    processes: Annotated[
        int | None, typer.Option(help="How many compile side by side; one a core if not given, up to four.", min=1)
    ] = None,
    json: Json = False,
) -> None:
    """Compile all kernels once and keep them; commands do the same for what they need when it is missing."""
    from wakewise.core.jit.precompile import compile_kernels as compile_all
    from wakewise.core.jit.precompile import is_warm

    began = time.perf_counter()
    there = is_warm()
    with ProgressBars().stage("compile") as progress:
        made = compile_all(progress=progress, processes=processes)
    took_s = time.perf_counter() - began
    for line in made.amiss:
        typer.echo(f"not compiled: {line}", err=True)
    figures = {"kernels": made.kernels, "not_compiled": list(made.amiss), "wall_s": took_s, "was_warm": there}
    compiled = f"{made.kernels} kernels compiled and kept, {took_s:.0f} s"
    answer(json, figures, "all kernels were compiled before" if there else compiled)
