"""A page whose parts were made early, while mesh and colours were not there yet, is the page that is made at once."""

import shutil

import pytest

from wakewise.ui.reports import begin_report, model, write_report
from wakewise.ui.reports.page import PageParts


def test_a_part_is_made_once():
    """The second time its maker is not asked."""
    draft = PageParts()
    assert draft.once("a", lambda: 1) == 1
    assert draft.once("a", lambda: pytest.fail("made again")) == 1
    assert draft.once("b", lambda: 2) == 2


@pytest.mark.slow
def test_the_page_of_a_draft_is_the_same_to_the_byte(made_up, report_text, tmp_path, monkeypatch):
    """Begun without the mesh, gone on without its colours; what was made then is not made again."""
    folder = tmp_path / made_up.name
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("report.html", "mesh.*"))
    draft = PageParts()
    begin_report(folder, draft, "mesh")
    shutil.copy2(made_up / "mesh.ply", folder)
    begin_report(folder, draft, "colours")
    for name in ("cloud_errors", "model_errors", "draw_cloud"):
        monkeypatch.setattr(model, name, lambda *_: pytest.fail("was made again"))
    assert write_report(folder, draft).read_text(encoding="utf-8") == report_text
