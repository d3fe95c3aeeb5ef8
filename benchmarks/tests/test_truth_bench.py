"""Figures held against outside data: readers, the error measure, what is missing, and the fast figures for real."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.ui.cli.main import run as wakewise
from wakewise_benchmarks import cube_channel as cc
from wakewise_benchmarks import truth
from wakewise_benchmarks.cube_channel_plot import draw_cube
from wakewise_benchmarks.truth_records import Asked, Part, rows_of

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[3] / "shared" / "data"))
FAST = tuple(name for name, part in truth.PARTS.items() if not part.slow)
TINY = cc.ChannelCase(cells_per_H=4, low_x=-3.5, high_x=9.0, width=3.0, develop=0.5, average=0.5, reynolds=500.0)


def write_profile(folder: Path, name: str, y_mm: np.ndarray, values: np.ndarray) -> Path:
    rows = "".join(f"  {y:.3E}   {v:.3E}\n" for y, v in zip(y_mm, values, strict=True))
    path = folder / name
    path.write_text(f"# Profile of u_m_vel.\n#   y (mm)    u_m_vel.(m/s)\n{rows}")
    return path


@pytest.fixture
def channel(tmp_path: Path) -> Path:
    """Made profiles of U before, beside and behind the cube, one V, one W and one stress."""
    y = np.linspace(1.0, 49.0, 25)
    u = 20.0 * (1.0 - (y / 25.0 - 1.0) ** 2)
    for name, values in (("mu__0101", u), ("mu__0302", 1.1 * u), ("mu__0701", 0.5 * u)):
        write_profile(tmp_path, f"{name}.dat", y, values)
    for name in ("mv__0701", "mw__0302", "fuu_0701"):
        write_profile(tmp_path, f"{name}.dat", y, np.full(25, 2.0))
    return tmp_path


def test_a_profile_is_read_with_its_place_from_its_name(channel: Path) -> None:
    """Heights become H, the codes of the name become x/H and z/H, and the bulk velocity is the mean over the height."""
    profiles = {p.quantity + f" {p.x_H:g} {p.z_H:g}": p for p in cc.read_profiles(channel)}
    assert set(profiles) == {"mu_ -3 0", "mu_ 0 1", "mu_ 2 0", "mv_ 2 0", "mw_ 0 1", "fuu 2 0"}
    assert profiles["mu_ 0 1"].y_H[0] == pytest.approx(0.04)
    assert cc.bulk_velocity(profiles["mu_ -3 0"]) == pytest.approx(40.0 / 3.0, rel=2e-3)


def test_files_that_are_no_profiles_are_refused(channel: Path, tmp_path: Path) -> None:
    """A name of no place, words for numbers, heights that fall or leave the channel, and no inflow: one line each."""
    y = np.array([1.0, 2.0])
    with pytest.raises(InputError, match="not a name of a profile"):
        cc.read_profile(write_profile(tmp_path, "mu__1901.dat", y, y))
    bad = tmp_path / "mu__0601.dat"
    bad.write_text("# a\n  1.0 fast\n")
    with pytest.raises(InputError, match="line 2"):
        cc.read_profile(bad)
    for wrong in (y[::-1], y + 49.0):
        with pytest.raises(InputError, match="heights must rise"):
            cc.read_profile(write_profile(tmp_path, "mu__0601.dat", wrong, y))
    bad.unlink()
    (tmp_path / "mu__1901.dat").unlink()
    (channel / "mu__0101.dat").unlink()
    with pytest.raises(InputError, match="inflow"):
        cc.read_profiles(channel)


def test_the_measured_files_are_read_whole() -> None:
    """340 measured velocities along the channel, and a bulk velocity near the stated Reynolds number, with air."""
    folder = DATA / "cube_channel"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not here; set WAKEWISE_DATA")
    profiles = cc.read_profiles(folder)
    assert sum(len(p.y_H) for p in profiles if p.quantity == "mu_") == 340
    assert len(profiles) == 12 + 12 + 7 + 12 + 12 + 12 + 7 + 7
    assert 3e4 < cc.bulk_velocity(cc.inflow_of(profiles)) * 0.025 / 1.5e-5 < 4.2e4


def test_the_error_measure_gives_what_was_put_in(channel: Path) -> None:
    """The measurement itself has no error; an offset of a tenth of the bulk velocity has an rms of a tenth."""
    profiles = cc.read_profiles(channel)
    bulk = cc.bulk_velocity(cc.inflow_of(profiles))

    def measured(quantity: str, x_H: float, z_H: float, y_H: np.ndarray) -> np.ndarray:
        (p,) = (p for p in profiles if (p.quantity, p.x_H, p.z_H) == (quantity, x_H, z_H))
        return np.interp(y_H, p.y_H, p.values) / bulk

    assert cc.rms(cc.differences(measured, profiles, "mu_", bulk)) < 1e-12
    off = cc.differences(lambda *where: measured(*where) + 0.1, profiles, "mu_", bulk)
    assert len(off) == 75
    assert cc.rms(off) == pytest.approx(0.1)
    assert truth.PARTS["cube_channel"].asked[0].met_by(cc.rms(off))


def test_a_shifted_profile_fails(channel: Path) -> None:
    """A field that is right but displaced by half a cube upwards is not met."""
    profiles = cc.read_profiles(channel)
    bulk = cc.bulk_velocity(cc.inflow_of(profiles))

    def shifted(quantity: str, x_H: float, z_H: float, y_H: np.ndarray) -> np.ndarray:
        (p,) = (p for p in profiles if (p.quantity, p.x_H, p.z_H) == (quantity, x_H, z_H))
        return np.interp(y_H - 0.5, p.y_H, p.values, left=0.0) / bulk

    assert not truth.PARTS["cube_channel"].asked[0].met_by(cc.rms(cc.differences(shifted, profiles, "mu_", bulk)))


def made_means(u: np.ndarray, case: cc.ChannelCase) -> cc.ChannelMeans:
    solid = cc.ChannelRun(case, np.array([1.0]), np.array([1.0])).solid
    moments = np.zeros((8, *solid.shape))
    moments[1] = np.where(solid, 0.0, u)
    moments[4] = moments[1] ** 2 + 0.04
    return cc.ChannelMeans(case=case, bulk=1.0, moments=moments, solid=solid, eddy_viscosity=1e-3)


def test_a_computed_field_is_read_at_measured_places() -> None:
    """Linear fields come back exactly between cells, walls and the cube's roof are zero, and stress loses the mean."""
    y = (np.arange(8) + 0.5) / 4
    means = made_means(np.broadcast_to(0.5 * y, (50, 12, 8)), TINY)
    assert means.at("mu_", 4.0, 0.0, np.array([0.3, 0.9, 1.4])) == pytest.approx([0.15, 0.45, 0.7])
    assert means.at("mu_", 0.5, 0.0, np.array([1.0, 1.0625, 1.125])) == pytest.approx([0.0, 0.28125, 0.5625])
    assert means.at("fuu", 4.0, 0.0, np.array([0.9])) == pytest.approx([0.04])
    with pytest.raises(InputError, match="not averaged"):
        means.at("fuv", 4.0, 0.0, y)


def test_below_the_first_cell_the_velocity_follows_the_law_of_the_wall() -> None:
    """At a high Reynolds number it is steep at floor, roof and ceiling; without the law, and for stresses, straight."""
    fast = replace(TINY, reynolds=40_000.0)
    y = np.array([0.01, 0.05, 0.125, 0.375])
    even = np.ones((50, 12, 8))
    law = made_means(even, fast)
    for floor, x_H in ((0.0, 4.0), (1.0, 0.5)):
        u = law.at("mu_", x_H, 0.0, floor + y)
        assert u[2:] == pytest.approx([1.0, 1.0])
        # The power 1/7 of the law.
        assert u[1] / u[0] == pytest.approx(5 ** (1 / 7), rel=1e-6)
        assert u[0] > 0.65
    assert law.at("mu_", 4.0, 0.0, 2.0 - y) == pytest.approx(law.at("mu_", 4.0, 0.0, y))
    straight = [0.08, 0.4, 1.0, 1.0]
    assert made_means(even, replace(fast, wall_law=False)).at("mu_", 4.0, 0.0, y) == pytest.approx(straight)
    assert law.at("fuu", 4.0, 0.0, y) == pytest.approx(0.04 * np.array(straight))
    assert made_means(-even, fast).at("mu_", 4.0, 0.0, y) == pytest.approx(-law.at("mu_", 4.0, 0.0, y))


def test_the_reattachment_is_where_the_flow_on_the_floor_turns() -> None:
    """A velocity that changes sign 2 H behind the rear face reattaches there; one that never does has none."""
    x = TINY.low_x + (np.arange(50) + 0.5) / 4
    u = np.broadcast_to((x - 3.0)[:, None, None], (50, 12, 8))
    assert made_means(u, TINY).reattachment_H() == pytest.approx(2.0)
    assert made_means(np.ones_like(u), TINY).reattachment_H() is None
    assert made_means(-np.ones_like(u), TINY).reattachment_H() is None


def test_a_small_run_keeps_its_flow_and_tells_all_figures(channel: Path, tmp_path: Path) -> None:
    """After one H of flow: the cube is still, what enters passes, every figure is finite, and a picture is drawn."""
    computed = truth.cube_figures(channel, no_progress, TINY)
    assert computed["flow_through"] == pytest.approx(1.0, abs=0.2)
    assert computed["points"] == 75
    assert all(np.isfinite(value) for key, value in computed.items() if "_rms_" in key)
    assert computed["reynolds_effective"] < computed["reynolds"] == 500.0
    without = truth.cube_figures(channel, no_progress, replace(TINY, wall_law=False))
    assert without["u_rms_rel"] != computed["u_rms_rel"]
    draw_cube({"cube": computed}, tmp_path / "cube.svg")
    assert (tmp_path / "cube.svg").read_text().startswith("<?xml")
    with pytest.raises(InputError, match="was not computed"):
        draw_cube({"cube": {}}, tmp_path / "cube.svg")
    with pytest.raises(InputError, match="allowed"):
        draw_cube({"cube": computed}, tmp_path / "cube.jpg")


def test_every_row_has_its_range_before_anything_is_computed() -> None:
    """A range needs an end; its words say it."""
    assert Asked(key="a", what="", how="", high=0.15).words == "<= 0.15"
    assert Asked(key="a", what="", how="", low=1.0, high=2.0).words == "1 to 2"
    assert Asked(key="a", what="", how="", low=6.0, high=6.0).words == "= 6"
    with pytest.raises(InputError, match="range with an end"):
        Asked(key="a", what="", how="")
    for part in truth.PARTS.values():
        assert len({a.key for a in part.asked}) == len(part.asked) > 0
        assert all(a.how for a in part.asked)


def test_what_is_missing_is_null_and_says_why(tmp_path: Path) -> None:
    """No folder of the part, no file, no value and no data at all: the figure is null, never 0 and never left out."""
    found = truth.run(BenchOptions(data=tmp_path, only=("cube_channel", "dynamics")))
    assert len(found["rows"]) == 3 == found["not_computed"]
    assert all(row["reached"] is None and row["met"] is None for row in found["rows"])
    assert found["rows"][0]["why"] == f"{tmp_path / 'cube_channel'} is missing"
    assert found["cube"]["u_rms_rel"] is None and "missing" in found["cube"]["why"]["u_rms_rel"]
    (tmp_path / "currents").mkdir()
    (row,) = truth.run(BenchOptions(data=tmp_path, only=("currents",)))["rows"]
    assert row["reached"] is None and "s08010.json" in row["why"]
    nothing = Part(
        name="currents", source="", asked=(Asked(key="a", what="", how="", high=1.0),), compute=lambda *_: {"a": None}
    )
    assert rows_of(nothing, tmp_path, no_progress)[0][0]["why"] == "it has no value"
    assert "--data" in rows_of(nothing, None, no_progress)[0][0]["why"]
    json.dumps(found)


def test_a_file_that_cannot_be_read_leaves_the_other_rows(tmp_path: Path) -> None:
    """Its own figures are null and name the folder and what was found; the parts beside it are computed."""
    (tmp_path / "currents").mkdir()
    (tmp_path / "currents" / "s08010.json").write_text("{}")
    found = truth.run(BenchOptions(data=tmp_path, only=("currents", "dynamics")))
    rows = {row["source"]: row for row in found["rows"]}
    assert rows["currents"]["reached"] is None and str(tmp_path / "currents") in rows["currents"]["why"]
    assert "is missing" in rows["dynamics"]["why"]


def test_without_a_data_folder_the_command_ends_with_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit 2 and what, where and what would be right; so does a part that there is not."""
    assert wakewise(["bench", "truth", "--data", str(tmp_path / "none")]) == 2
    said = capsys.readouterr().err
    assert f"--data {tmp_path / 'none'}: no such folder" in said and "WAKEWISE_DATA" in said
    assert said.count("\n") == 1
    assert wakewise(["bench", "truth", "--data", str(tmp_path), "--only", "moon"]) == 2
    assert "--only moon: no such part, allowed cube_channel" in capsys.readouterr().err


def test_the_table_has_a_line_for_every_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is missing is in the table too, with its reason."""
    assert wakewise(["bench", "truth", "--data", str(tmp_path), "--only", "dynamics,mesh_bunny"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("is missing") == 3
    assert "0 met, 0 missed, 3 not computed" in printed


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST)
def test_the_fast_figures_are_met_for_real(name: str) -> None:
    """Each part that takes seconds is computed from its data, and all of its figures are as asked."""
    if not (DATA / name).is_dir():
        pytest.skip(f"{DATA / name} is not here; set WAKEWISE_DATA")
    found = truth.run(BenchOptions(data=DATA, only=(name,)))
    assert [(row["what"], row["reached"]) for row in found["rows"] if row["met"] is not True] == []
