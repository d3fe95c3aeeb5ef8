"""The page of the architecture is what the source says, and no package imports one above it."""

import runpy
from pathlib import Path

TOOL = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "draw_layers.py"))


def test_the_page_of_the_architecture_is_up_to_date() -> None:
    """`make docs` would write what is there."""
    assert TOOL["PAGE"].read_text(encoding="utf-8") == TOOL["page"](), "run make docs"


def test_no_package_imports_one_above_it() -> None:
    """Each arrow points down in the order of the layers."""
    layers = TOOL["LAYERS"]
    up = [
        (name, other)
        for name, others in TOOL["imports"]().items()
        for other in others
        if layers.index(other) < layers.index(name)
    ]
    # api sits between the pages and the commands of ui: a contract in pyproject.toml orders these three.
    assert [edge for edge in up if edge != ("api", "ui")] == []
