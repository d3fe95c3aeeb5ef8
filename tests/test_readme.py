"""The pages for readers: every line to paste is one that works, every link leads somewhere, the Python runs."""

import ast
import re
import shlex
from pathlib import Path

import polars as pl
import pytest
import typer

from wakewise.ui.cli.main import app

ROOT = Path(__file__).parents[1]
PAGES = ["README.md", "CONTRIBUTING.md"]
PAGES += [f"docs/{name}.md" for name in ("README", "howto", "limits", "python", "extending", "worlds")]
PAGES += [f"docs/{name}.md" for name in ("reproduce", "campaigns", "clusters", "tutorial")]
PAGES += ["docs/vehicle-file.md"]


def blocks(page, language=""):
    """Code blocks of a page in this language."""
    found, inside = [], None
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines(keepends=True):
        if not line.startswith("```"):
            if inside is not None:
                inside[1].append(line)
        elif inside is None:
            inside = (line.strip("`\n"), [])
        else:
            found.append(inside)
            inside = None
    return ["".join(lines) for name, lines in found if name == language]


def shell_lines():
    """Every line of the pages that begins with `wakewise`."""
    return [
        (page, line)
        for page in PAGES
        for block in blocks(page)
        for line in block.splitlines()
        if line.startswith("wakewise ")
    ]


def parse(line):
    """The command of a line takes its words: command, options and arguments exist and have the right form."""
    words = shlex.split(line, comments=True)[1:]
    command = typer.main.get_command(app)
    while hasattr(command, "commands"):
        assert words[0] in command.commands, f"no command {words[0]}"
        command = command.commands[words.pop(0)]
    if words != ["--help"]:
        command.make_context(command.name, words)


@pytest.mark.parametrize(("page", "line"), shell_lines())
def test_a_line_to_paste_is_one_that_the_command_takes(page, line):
    """Commands and options are those that exist."""
    parse(line)


def test_a_line_with_a_wrong_option_would_be_found():
    """The test above can fail."""
    with pytest.raises(Exception, match="No such option: --standof"):
        parse("wakewise scan --standof 0.6")


def test_make_lines_have_their_targets():
    """What README says to make can be made."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for block in blocks("README.md") + blocks("CONTRIBUTING.md"):
        for target in re.findall(r"^make ([\w-]+)", block, re.MULTILINE):
            assert re.search(rf"^(?:[\w-]+ )*{target}(?: [\w-]+)*:", makefile, re.MULTILINE), target


def test_the_environment_is_activated_before_the_first_command():
    """Pasted from the top, every `wakewise` line finds its command."""
    text = "".join(blocks("README.md"))
    assert text.index("make setup") < text.index(". .venv/bin/activate") < text.index("\nwakewise ")


def test_the_readme_is_short():
    """It is read in a minute: at most 6 kB."""
    assert (ROOT / "README.md").stat().st_size <= 6000


def test_the_python_of_the_readme_runs(capsys):
    """Pasted, it flies and prints a line for each method; the flights are cut to a second."""
    (shown,) = blocks("README.md", "python")
    exec(shown.replace("(method=method))", "(method=method), duration_s=1.0)"), {})
    (told,) = blocks("README.md", "text")
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == [
        line.split(":")[0] for line in told.splitlines()
    ]


def test_the_python_of_the_page_of_tasks_is_the_example():
    """Word for word, but for the argument that says how long."""
    example = (ROOT / "examples" / "own_controller.py").read_text(encoding="utf-8")
    shown = example.partition('"""\n\n')[2].replace("import sys\n\n", "")
    shown = shown.replace(", duration_s=float(sys.argv[1]) if sys.argv[1:] else None", "")
    assert blocks("docs/howto.md", "python")[0] == shown


@pytest.mark.parametrize("page", PAGES)
def test_links_of_a_page_lead_somewhere(page):
    """Relative links name files or folders that are there."""
    text = (ROOT / page).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text)
    here = (ROOT / page).parent
    for link in links:
        assert link.startswith("http") or (here / link).exists(), link


def test_the_index_names_every_page():
    """No page and no decision of docs/ is missing from its index."""
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    pages = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "decisions").glob("*.md")]
    missing = [page.name for page in pages if page.name != "README.md" and page.name not in index]
    assert missing == []


@pytest.mark.slow
def test_the_python_of_docs_python_runs(tmp_path, monkeypatch):
    """Pasted one after the other, the blocks run; whole trials, which take minutes, are left out."""
    monkeypatch.chdir(tmp_path)
    told = [block for block in blocks("docs/python.md", "python") if "ww.trial(" not in block]
    names = {}
    exec("\n".join(told).replace("duration_s=13.0", "duration_s=1.0"), names)
    assert names["flight"].figures["target_speed_mean_m_s"] >= 0.0
    assert names["gentle"].gap < 1e-6


def test_the_python_of_docs_campaigns_runs(tmp_path, monkeypatch, capsys):
    """The statistics run on a campaign's table, and what needs a cluster is Python at least."""
    monkeypatch.chdir(tmp_path)
    rows = [
        {
            "target": "brain",
            "world": "mud",
            "seed": seed,
            "method": method,
            "target_speed_mean_m_s": mm_s * 1e-3 + noise,
        }
        for method, mm_s in (("dp", 8.0), ("mpc", 9.0), ("wake-aware", 3.0))
        for seed, noise in enumerate((0.0, 1e-4, -2e-4, {"dp": 3e-4, "mpc": 1e-4, "wake-aware": 0.0}[method]))
    ]
    pl.DataFrame(rows).write_parquet("trials.parquet")
    ran = [block for block in blocks("docs/campaigns.md", "python") if "trials.parquet" in block]
    assert len(ran) == 1
    exec(ran[0], {})
    assert re.findall(r"^(-\d\.\d) mm/s against (\w+)", capsys.readouterr().out, re.MULTILINE) == [
        ("-5.1", "dp"),
        ("-6.0", "mpc"),
    ]
    parsed = [ast.parse(block) for page in ("campaigns", "clusters") for block in blocks(f"docs/{page}.md", "python")]
    assert len(parsed) == 5


def bare(text):
    """Classes and functions of a module by name, without their docstrings."""
    found = {}
    for node in ast.parse(text).body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            if isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant):
                del node.body[0]
            found[node.name] = ast.dump(node)
    return found


def test_the_cookbook_is_the_module_that_is_tested():
    """docs/extending.md shows what tests/cookbook installs and flies."""
    (shown,) = blocks("docs/extending.md", "python")
    assert bare(shown) == bare((ROOT / "tests" / "cookbook" / "reef_parts.py").read_text(encoding="utf-8"))


def test_every_kind_of_plugin_is_in_the_docs():
    """docs/extending.md names each group of entry points."""
    from wakewise.core.plugins import GROUPS

    text = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    assert [group for group in GROUPS.values() if f"`{group}`" not in text] == []


def table(page, heads):
    """Rows of the table of a page whose head row this is, as lists of cells."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    (start,) = (i for i, line in enumerate(lines) if line == heads)
    rows = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_the_page_of_validation_says_what_the_tank_gets_wrong():
    """Its table is the tank's own, row by row, and nothing that the water has not is left out; misses are called so."""
    from wakewise.simulation.tank.validation_limits import ABSENT, limits_table

    rows = table("docs/validation.md", "| | law | asked | reached | what it means for a claim |")
    told = limits_table()
    assert [row[1:] for row in rows] == [
        [f"*{row['name']}*: {row['law']}", row["asked"], row["reached"], row["means"]] for row in told
    ]
    assert [row[0] for row in rows] == [{"no": "**missed**", "yes": "kept"}[row["met"]] for row in told]
    text = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    assert [line for line in ABSENT if f"\n- {line}\n" not in text] == []


def test_readme_and_limits_count_the_laws_and_lead_to_them():
    """How many laws are measured and how many are missed is the tank's own count; three are named, all are linked."""
    from wakewise.simulation.tank.validation_limits import limits_table

    laws = limits_table()
    missed = sum(row["met"] == "no" for row in laws)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"against {len(laws)} laws; {missed} are missed" in readme
    text = (ROOT / "docs" / "limits.md").read_text(encoding="utf-8")
    section = text.split("## What the tank gets wrong")[1].split("\n## ")[0]
    assert f"against {len(laws)} laws" in " ".join(section.split()) and f"; {missed} are missed" in section
    assert section.count("\n- ") == len(table("docs/validation.md", "| error | size | consequence |")) == 3
    assert "(validation.md)" in section


def test_the_page_of_worlds_lists_those_that_there_are():
    """Names and titles are those of the library, and each world's water is what the page says."""
    from wakewise.operation import load_scenario
    from wakewise.operation.worlds.library import load_world, world_names
    from wakewise.operation.worlds.makers import WORLDS

    rows = table("docs/worlds.md", "| world | what |")
    assert rows == [[f"`{name}`", load_world(name).file.title] for name in world_names()]
    assert {load_world(name).file.flow for name in world_names()} == {"tank"}
    assert {row[0].strip("`") for row in table("docs/worlds.md", "| flow | what |")} == set(WORLDS)
    default = load_scenario("quick", None, {}).world
    assert f"Presets fly in `{default}`" in (ROOT / "docs" / "worlds.md").read_text(encoding="utf-8")


def test_the_draws_of_the_page_of_worlds_are_taken(tmp_path):
    """The scenario shown there can be loaded, keeps the world's other draws, and two seeds draw two worlds from it."""
    from wakewise.operation import load_scenario
    from wakewise.operation.worlds.library import load_world

    (shown,) = blocks("docs/worlds.md", "yaml")
    (tmp_path / "my.yaml").write_text(shown, encoding="utf-8")
    scenario = load_scenario("quick", tmp_path / "my.yaml", {})
    assert set(load_world("reef").randomize) < set(scenario.randomize)
    first, second = (scenario.replace(seed=seed).drawn() for seed in (3, 4))
    assert scenario.mission.standoff_m == first.mission.standoff_m == 0.6
    for seen in (first, second):
        assert -4.0 <= seen.tank.mismatch.trim_N <= 0.0
        assert seen.target.kind in ("gorgonian", "soft-coral")
    assert first.tank != second.tank
