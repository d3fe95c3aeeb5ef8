"""A trial's folder belongs to one trial: fields and the contents of the files that it names."""

import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.operation.trial_folder import changed_files, check_place, write_or_check_scenario


def test_a_folder_is_refused_when_a_file_that_the_scenario_names_has_changed(tmp_path, monkeypatch):
    """The same path with other contents is another trial; a folder without check sums, or without the file, is not."""
    monkeypatch.chdir(tmp_path)
    mine, folder = tmp_path / "mine.yaml", tmp_path / "run"
    mine.write_text("mass_kg: 11.0\n")
    scenario = ww.Scenario.preset("quick").model_copy(update={"vehicle": "mine.yaml"})
    write_or_check_scenario(folder, scenario)
    check_place(folder, scenario)
    mine.write_text("mass_kg: 11.6\n")
    with pytest.raises(InputError, match=r"holds another trial \(the contents of mine.yaml have changed\)"):
        check_place(folder, scenario)
    path = folder / "scenario.yaml"
    assert changed_files(path, scenario) == ["the contents of mine.yaml have changed"]
    mine.unlink()
    check_place(folder, scenario)
    mine.write_text("mass_kg: 11.6\n")
    path.write_text("".join(line for line in path.read_text().splitlines(True) if "sha256" not in line))
    check_place(folder, scenario)
