"""Every package exports what it states; a lazy one imports its exports when asked, and gives what a plain one would."""

import importlib
import pkgutil
import subprocess
import sys

import pytest

import wakewise
from wakewise.core.lazy_imports import _LazyPackage

PACKAGES = [
    package.name
    for package in pkgutil.walk_packages(wakewise.__path__, "wakewise.")
    if package.ispkg and isinstance(importlib.import_module(package.name), _LazyPackage)
]


def test_packages_with_heavy_libraries_are_lazy():
    """Those that photographs, models, reports and trials are made in."""
    assert {
        "wakewise.vision.imaging",
        "wakewise.vision.reconstruction",
        "wakewise.ui.reports",
        "wakewise.experiments.trials",
    } <= set(PACKAGES)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_lazy_package_gives_what_it_states(name):
    """Every name of `__all__` can be had and is listed by `dir`; what is not there is said as ever."""
    package = importlib.import_module(name)
    assert set(package.__all__) == set(package._homes) <= set(dir(package))
    for export in package.__all__:
        assert getattr(package, export) is not None
    absent = "nothing"
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        getattr(package, absent)
    with pytest.raises(ImportError, match="cannot import name 'nothing'"):
        exec(f"from {name} import nothing")


def test_a_module_below_a_package_does_not_hide_the_export_of_its_name():
    """`imaging.photograph` is the function, whichever is imported first."""
    script = (
        "import wakewise.vision.imaging.photograph\n"
        "from wakewise.vision.imaging import photograph\n"
        "assert callable(photograph), photograph\n"
        "import wakewise.vision.imaging.blur\n"
        "assert wakewise.vision.imaging.blur.__name__ == 'wakewise.vision.imaging.blur'\n"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


EVERY = [
    module.name
    for module in pkgutil.walk_packages(wakewise.__path__, "wakewise.")
    if module.ispkg and not module.name.startswith("wakewise_nerf.field")
]


@pytest.mark.parametrize("package", ["wakewise", *EVERY])
def test_all_that_a_package_offers_is_there(package: str) -> None:
    """`from package import *` works, and no name is offered twice."""
    module = importlib.import_module(package)
    offered = list(getattr(module, "__all__", ()))
    assert [name for name in offered if not hasattr(module, name)] == []
    assert len(offered) == len(set(offered))
