"""Naming a vehicle or a matrix by whatever file there is."""

import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import compare_with, find_vehicle
from wakewise.robot.vehicles import draft_yaml, load_draft

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))


def data(path: str) -> Path:
    if not (DATA / path).is_file():
        pytest.skip(f"{path} is not here; set WAKEWISE_DATA")
    return DATA / path


def test_a_library_name_and_a_vehicle_file_are_read_as_such(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(draft_yaml(load_draft("orca")))
    assert find_vehicle("orca").missing == find_vehicle(str(path)).missing
    with pytest.raises(InputError, match="not in the library"):
        find_vehicle("submarine")
    with pytest.raises(InputError, match="no such file"):
        find_vehicle(str(tmp_path / "none.sdf"))


def test_a_file_of_another_project_is_imported() -> None:
    found = find_vehicle(str(data("vehicle_models/vortex_orca/orca.yaml")))
    assert np.allclose(found.allocation_matrix, load_draft("orca").allocation_matrix, atol=1e-9)


def test_the_librarys_gazebo_vehicles_are_what_their_files_say() -> None:
    """Two readings of one file, by hand and by the importer, give one vehicle (angles are rounded to 1e-3 there)."""
    for name, model in (("bluerov2-gazebo", "bluerov2"), ("bluerov2-heavy-gazebo", "bluerov2_heavy")):
        ours = load_draft(name)
        theirs = find_vehicle(str(data(f"vehicle_models/bluerov2_gz/models/{model}/model.sdf")))
        assert np.allclose(theirs.allocation_matrix, ours.allocation_matrix, atol=1e-3)
        assert theirs.quadratic_damping is not None
        assert ours.quadratic_damping is not None
        assert np.allclose(theirs.quadratic_damping, ours.quadratic_damping)
        assert theirs.displaced_volume_m3 == pytest.approx(ours.displaced_volume_m3, rel=1e-6)
        assert theirs.p_BB_m is not None
        assert ours.p_BB_m is not None
        assert np.allclose(theirs.p_BB_m, ours.p_BB_m, atol=1e-9)


def test_rexrovs_matrix_agrees_whatever_file_it_is_in(tmp_path: Path) -> None:
    tam = data("vehicle_models/rexrov/uuv_control/uuv_thruster_manager/config/rexrov/TAM.yaml")
    rexrov = load_draft("rexrov")
    assert compare_with(rexrov, str(tam)).agree == 48
    path = tmp_path / "mine.csv"
    np.savetxt(path, rexrov.allocation_matrix, delimiter=",")
    assert compare_with(rexrov, str(path)).agree == 48


def test_ardusubs_table_of_factors_agrees_with_the_heavy() -> None:
    found = compare_with(load_draft("bluerov2-heavy"), str(data("ardusub/ardusub_vectored_6dof_mixing.csv")))
    assert (found.compared, found.agree) == (48, 48)
    assert compare_with(load_draft("bluerov2-heavy"), "ardusub").agree == 48


def test_a_matrix_without_geometry_has_nothing_to_be_compared_with() -> None:
    tam = data("vehicle_models/rexrov/uuv_control/uuv_thruster_manager/config/rexrov/TAM.yaml")
    with pytest.raises(InputError, match="holds no places of thrusters"):
        compare_with(find_vehicle(str(tam)), "ardusub")
