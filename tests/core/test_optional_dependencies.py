"""What is missing is said in one line, and the extras are those of pyproject.toml."""

import re
import tomllib
from pathlib import Path

import pytest

from wakewise.core import optional_dependencies
from wakewise.core.errors import MissingExtra
from wakewise.core.optional_dependencies import EXTRAS, has, missing_extra, need

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def packages(requirements):
    return {re.match(r"[\w-]+", requirement).group() for requirement in requirements}


def test_the_extras_are_those_of_the_project_file():
    """Same names, same packages; none of them is in the core but pillow, which scikit-image brings."""
    stated = {name: packages(them) for name, them in PROJECT["optional-dependencies"].items() if name != "all"}
    assert stated == {name: set(modules.values()) for name, modules in EXTRAS.items()}
    assert not packages(PROJECT["dependencies"]) & set().union(*stated.values())
    assert PROJECT["optional-dependencies"]["all"] == ["wakewise[photos,reports,logs,cockpit]"]


def test_all_that_is_missing_is_said_at_once(monkeypatch):
    """Each package once, each extra that lacks something, and how they are installed."""
    monkeypatch.setattr(optional_dependencies, "_is_here", lambda module: module not in ("cv2", "foxglove"))
    assert not has("photos")
    assert not has("logs")
    with pytest.raises(MissingExtra) as refusal:
        need("wakewise scan", "photos", "reports", "logs")
    assert str(refusal.value) == (
        "wakewise scan needs opencv-python-headless and foxglove-sdk, which are not installed: "
        "pip install -e '.[photos,reports,logs]' (in the clone's folder)"
    )
    need("a neural field", "nerf")
    need("a cloud", "photos", only=("embreex",))


def test_a_failed_import_names_the_extra_that_holds_the_module():
    """The preferred one where several do; none for what belongs to no extra."""
    fault = ModuleNotFoundError("No module named 'cv2.aruco'", name="cv2.aruco")
    assert "'.[photos]'" in str(missing_extra("x", fault))
    assert "'.[reports]'" in str(missing_extra("x", fault, "reports"))
    assert missing_extra("x", ModuleNotFoundError("No module named 'tank'", name="tank")) is None
    assert missing_extra("x", ImportError("libGL.so.1: cannot open")) is None
