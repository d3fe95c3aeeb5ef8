"""Photographs of the relief, taken once."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from relief import take_photos


@pytest.fixture(scope="session")
def relief_photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("relief") / "images"
    return folder, take_photos(folder)
