"""What the site makes of pages as they stand in the repository: links, blocks, the diagram of the layers."""

import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def site():
    """The extension, which needs no Sphinx to be read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS / "_extensions"))
        import site_pages

        yield site_pages
    for name in ("site_pages", "layer_diagram"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize(
    ("link", "on_the_site"),
    [
        ("[a](howto.md#scan)", "[a](/howto.md#scan)"),
        ("[a](../README.md#install)", "[a](/index.md)"),
        ("[a](../CONTRIBUTING.md)", "[a](/project/contributing.md)"),
        ("[a](results/)", "[a](/results/README.md)"),
        ("[`a.py`](../examples/own_target.py)", "{download}`a.py <../examples/own_target.py>`"),
        ("[a](../examples)", "a"),
        ("![a](images/wash.webp)", "![a](images/wash.webp)"),
        ("[a](https://example.org)", "[a](https://example.org)"),
        ("[a](nowhere.md)", "[a](nowhere.md)"),
        ("```\n[a](../examples)\n```\n", "```\n[a](../examples)\n```\n"),
    ],
)
def test_a_link_leads_to_what_the_site_has(site, link, on_the_site):
    """A page to a page, a file to a download, a folder to its name; what is not there stays and is then an error."""
    assert site.links_of_site(link, DOCS, DOCS) == on_the_site


def test_pages_of_the_root_are_those_of_the_project_folder(site):
    """Each has a file in docs/project, so that Sphinx finds a page to fill."""
    for page, name in site.OF_ROOT.items():
        assert (DOCS / f"{page}.md").is_file() and (DOCS.parent / name).is_file()


def test_the_diagram_shows_every_package_and_every_arrow(site):
    """Names and arrows of docs/architecture.md, but the one from api up to ui."""
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    mermaid = re.search(r"```mermaid\n(.*?)```", text, re.DOTALL)[1]
    drawn = site.layer_diagram(mermaid)
    names = re.findall(r"^\s+(\w+)$", mermaid, re.MULTILINE)
    assert len(names) == 20 and re.findall(r"<text[^>]*>(\w+)</text>", drawn) == sorted(
        names, key=lambda name: drawn.index(f">{name}<")
    )
    assert drawn.count(" C") == mermaid.count("-->") - 1


def test_blocks_without_a_language_get_one(site):
    """The opening fence alone; blocks that name theirs keep it."""
    assert site._named_blocks("```\nmake\n```\n```python\n1\n```", "bash") == "```bash\nmake\n```\n```python\n1\n```"
