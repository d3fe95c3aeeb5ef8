"""Every size, seed and depth that is given for a target is used or refused, and a misspelt name has a guess."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.core.settings import MAX_SEED
from wakewise.scene.targets import Mesh, coral, coral_kinds, find_target, write_mesh
from wakewise.ui.cli.main import run

BOX = Mesh(
    np.array([[0.0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def made(seed: int) -> Mesh:
    """A target from outside."""
    return Mesh(BOX.vertices_m * (1.0 + seed), BOX.faces)


def none(seed: int) -> None:
    """Forgets to return its mesh."""


def unknown_place(seed: int) -> Mesh:
    return Mesh(np.full((4, 3), np.nan), BOX.faces)


def faceless(seed: int) -> Mesh:
    return Mesh(BOX.vertices_m, np.zeros((0, 3), dtype=np.int64))


@pytest.mark.parametrize(
    ("maker", "words"),
    [
        ("none", "what it gave: None is a NoneType, must be a Mesh"),
        ("unknown_place", "vertices_m: holds NaN or infinity"),
        ("faceless", "faces: none, allowed"),
    ],
)
def test_a_target_from_outside_that_is_no_mesh_is_refused_by_name(maker: str, words: str) -> None:
    kind = f"{__name__}:{maker}"
    with pytest.raises(InputError) as caught:
        find_target(kind, 1.5)
    assert str(caught.value).startswith(f"target '{kind}': {words}")
    assert "\n" not in str(caught.value)


@pytest.fixture
def box(tmp_path: Path) -> str:
    path = tmp_path / "box.ply"
    write_mesh(path, BOX)
    return str(path)


@pytest.mark.parametrize("kind", [*coral_kinds(), f"{__name__}:made"])
@pytest.mark.parametrize("size_m", [0.3, -1.0, 100.0])
def test_a_size_is_refused_where_nothing_is_scaled(kind: str, size_m: float) -> None:
    with pytest.raises(InputError, match=r"size_m .* this one has its own size"):
        find_target(kind, 1.5, size_m=size_m)


def test_a_mesh_file_is_scaled_and_has_no_seed(box: str) -> None:
    assert ww.load_target(box, size_m=0.6).mesh.extent_m.max() == pytest.approx(0.6)
    with pytest.raises(InputError, match="seed: 3, a mesh file has only one individual"):
        ww.load_target(box, seed=3)
    for size_m in (-1.0, 0.0, 100.0, float("nan")):
        with pytest.raises(InputError, match="target size"):
            ww.load_target(box, size_m=size_m)


@pytest.mark.parametrize("bed_z_m", [-5.0, 0.0, float("nan"), float("inf"), "1", True, None])
def test_a_bed_lies_below_the_surface(bed_z_m: Any, box: str) -> None:
    for kind in ("brain", box):
        with pytest.raises(InputError, match="bed_z_m"):
            ww.load_target(kind, bed_z_m=bed_z_m)


@pytest.mark.parametrize("seed", [-1, MAX_SEED + 1, 2**200, 1.0, True, "1", None])
def test_a_seed_is_a_whole_number_of_64_bits(seed: Any) -> None:
    with pytest.raises(InputError, match="seed"):
        ww.load_target("brain", seed=seed)
    with pytest.raises(InputError, match="seed"):
        coral("plate", seed)
    if seed not in (1.0, "1"):  # in a file those are the number one
        for field in ("seed", "target.seed"):
            with pytest.raises(InputError, match=field):
                ww.Scenario.preset("quick", **{field: seed})
    assert ww.Scenario.preset("quick", seed=MAX_SEED).seed == MAX_SEED


@pytest.mark.parametrize("kind", [*coral_kinds(), f"{__name__}:made"])
def test_a_scenario_takes_a_size_only_with_a_mesh_file(kind: str, box: str) -> None:
    """Whatever the size; with a file it is one that a target has."""
    for size_m in (1e-9, 0.3, 2.0):
        with pytest.raises(InputError, match=r"size_m"):
            ww.Scenario.preset("quick", **{"target.kind": kind, "target.size_m": size_m})
    assert ww.Scenario.preset("quick", **{"target.kind": box, "target.size_m": 0.3}).target.size_m == 0.3
    for size_m in (1e-9, -1.0, 3.0):
        with pytest.raises(InputError, match=r"target\.size_m"):
            ww.Scenario.preset("quick", **{"target.kind": box, "target.size_m": size_m})


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("corall", ["unknown, did you mean soft-coral?", "brain, branching", "or a mesh file"]),
        ("Brain", ["did you mean brain?"]),
        ("zzz", ["unknown, allowed are brain"]),
        ("gone.ply", ["gone.ply", "no such file"]),
        ("there/gone", ["there/gone"]),
    ],
)
def test_a_target_that_is_not_there_has_a_guess_or_is_no_file(
    kind: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError) as caught:
        find_target(kind, 1.5)
    assert run(["target", "show", kind]) == 2
    for said in (str(caught.value), capsys.readouterr().err):
        for word in words:
            assert word in said


def test_the_command_uses_or_refuses_a_size_too(box: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["target", "show", "brain", "--target-size", "0.3"]) == 2
    assert "has its own size" in capsys.readouterr().err
    assert run(["target", "show", box, "--target-size", "0.6"]) == 0
