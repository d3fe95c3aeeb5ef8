"""The BlueOS extension holds together without Docker: labels, sources, requirements, settings, what it carries."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from bare import bare
from wakewise import __version__
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.vehicle_summary import VehicleSummary, read_vehicle_summary
from wakewise_ardusub.wash_meter.run import MeterSettings
from wakewise_ardusub.wash_savings import WashSavingsCalculator

ROOT = Path(__file__).parents[4]
FOLDER = ROOT / "packages/wakewise-ardusub/extensions" / "blueos"
TYPES = {"device-integration", "example", "theme", "tool", "other"}
"""Types of extensions that BlueOS' store knows."""


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def instructions() -> list[tuple[str, str]]:
    """The Dockerfile's instructions with what they say, lines joined."""
    text = (FOLDER / "Dockerfile").read_text(encoding="utf-8")
    whole = re.sub(r"\\\n", "", "\n".join(line for line in text.splitlines() if not line.startswith("#")))
    return [(line.partition(" ")[0], line.partition(" ")[2].strip()) for line in whole.splitlines() if line.strip()]


def expanded(word: str, known: dict[str, str]) -> str:
    """A word of an instruction as BuildKit reads it (moby/buildkit, frontend/dockerfile/shell).

    What stands in single quotes stays as it is. In double quotes and without any, $NAME and ${NAME} are replaced, and
    a backslash makes the next sign plain, in double quotes only a quote, a dollar or a backslash.
    """
    found, at, quote = "", 0, ""
    while at < len(word):
        sign = word[at]
        named = re.compile(r"\$(?:(\w+)|\{(\w+)\})").match(word, at)
        if quote == "'":
            quote, found = ("", found) if sign == "'" else (quote, found + sign)
        elif sign == "\\" and at + 1 < len(word) and (not quote or word[at + 1] in '"$\\'):
            at += 1
            found += word[at]
        elif named:
            found += known.get(named[1] or named[2], "")
            at = named.end() - 1
        elif sign == '"' or (sign == "'" and not quote):
            quote = "" if quote else sign
        else:
            found += sign
        at += 1
    assert not quote, f"a quote is open: {word}"
    return found


@pytest.fixture(scope="module")
def labels(instructions: list[tuple[str, str]]) -> dict[str, str]:
    """As an image has them that somebody built with OWNER=reef-lab."""
    arguments = {said for name, said in instructions if name == "ARG"}
    assert arguments == {"OWNER"}
    found = {}
    for name, said in instructions:
        if name == "LABEL":
            key, _, value = said.partition("=")
            found[key] = expanded(value, {"OWNER": "reef-lab"})
    return found


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("'a $OWNER'", "a $OWNER"), ('"a $OWNER"', "a reef"), ('"a ${OWNER}/b"', "a reef/b"), ("a$OWNER", "areef"),
        (r'"\"x\": \$OWNER"', '"x": $OWNER'), ("'{\"a\": 1}'", '{"a": 1}'), ('"it\'s"', "it's"), ('"$NOBODY"', ""),
    ],
)  # fmt: skip
def test_words_are_expanded_as_a_build_does_it(word: str, value: str) -> None:
    """By the rules of Dockerfiles."""
    assert expanded(word, {"OWNER": "reef"}) == value


def test_every_label_leads_to_who_publishes_it(labels: dict[str, str]) -> None:
    """No label keeps a name that stands for something; the page's address asks for the image's tag."""
    assert "$" not in "".join(labels.values())
    assert "OWNER" not in "".join(labels.values())
    for link in (*json.loads(labels["links"]).values(), labels["readme"]):
        assert "/reef-lab/wakewise" in link
    assert (ROOT / labels["readme"].partition("{tag}/")[2]).samefile(FOLDER / "README.md")
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert f"git tag {labels['version']}" in readme
    assert f"wakewise-wash-meter:{labels['version']}" in readme


def test_the_labels_are_what_blueos_reads(labels: dict[str, str]) -> None:
    """All of them, JSON where JSON is asked for, of the kinds that the store's builder takes."""
    assert set(labels) == {
        "version", "permissions", "authors", "company", "readme", "links", "type", "tags", "requirements",
    }  # fmt: skip
    assert labels["version"] == __version__
    assert re.fullmatch(r"\d+\.\d+\.\d+", labels["version"])
    for author in json.loads(labels["authors"]):
        assert set(author) == {"name", "email"}
    assert {"name", "about", "email"} == set(json.loads(labels["company"]))
    assert all(isinstance(link, str) and link.startswith("https://") for link in json.loads(labels["links"]).values())
    assert labels["readme"].startswith("https://")
    assert "{tag}" in labels["readme"]
    assert labels["type"] in TYPES
    assert 1 <= len(json.loads(labels["tags"])) <= 10
    assert re.fullmatch(r"core >= \d+\.\d+", labels["requirements"])


def test_the_container_may_do_what_it_needs_and_no_more(
    labels: dict[str, str], instructions: list[tuple[str, str]]
) -> None:
    """Two ports that are exposed and bound, one folder that shadows nothing of the image; not privileged."""
    asked: dict[str, Any] = json.loads(labels["permissions"])
    assert set(asked) == {"ExposedPorts", "HostConfig"}
    host = asked["HostConfig"]
    exposed = " ".join(said for name, said in instructions if name == "EXPOSE").split()
    assert set(asked["ExposedPorts"]) == set(host["PortBindings"]) == set(exposed) == {"8765/tcp", "14770/udp"}
    # BlueOS finds the page's port by itself; the endpoint's must be the one that is written in the README.
    assert host["PortBindings"] == {"8765/tcp": [{"HostPort": ""}], "14770/udp": [{"HostPort": "14770"}]}
    assert not {"Privileged", "NetworkMode", "CapAdd", "Devices"} & set(host)
    assert 0 < host["CpuQuota"] <= host["CpuPeriod"]
    inside = [bind.split(":")[1] for bind in host["Binds"]]
    copied = [said.split()[-1] for name, said in instructions if name == "COPY"]
    assert not any(to.startswith(bind) for bind in inside for to in copied)


def test_every_source_that_is_copied_is_there(instructions: list[tuple[str, str]]) -> None:
    """From the root of the repository; the entry is among them."""
    sources = [source for name, said in instructions if name == "COPY" for source in said.split()[:-1]]
    assert all((ROOT / source).exists() for source in sources), sources
    entry = next(said for name, said in instructions if name == "ENTRYPOINT")
    assert json.loads(entry) == ["python3", "/opt/wakewise/entry.py"]
    assert "packages/wakewise-ardusub/extensions/blueos/entry.py" in sources
    links = re.findall(r"\]\((?!https?:)([^)#]+)", (FOLDER / "README.md").read_text(encoding="utf-8"))
    assert all((FOLDER / link).exists() for link in links), links
    assert not any(word in said for _, said in instructions for word in ("curl", "wget", "ADD http"))


def test_what_is_installed_is_what_the_meter_imports(instructions: list[tuple[str, str]]) -> None:
    """NumPy by Debian, the rest by pip: together exactly the third parties of the meter's imports."""
    lines = (FOLDER / "requirements.txt").read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split("==") for line in lines if line and not line.startswith("#"))
    by_debian = next(said for name, said in instructions if name == "RUN" and "apt-get install" in said)
    assert "python3-numpy" in by_debian
    found = bare(
        "before = set(sys.modules)\n"
        "import wakewise_ardusub.wash_meter.embedded, pymavlink.dialects.v20.ardupilotmega\n"
        "print(*({m.partition('.')[0] for m in set(sys.modules) - before} - set(sys.stdlib_module_names)))"
    )
    # fastcrc is taken by pymavlink where it is there.
    assert {"numpy", "wakewise", "wakewise_ardusub", "fastcrc", *pinned} == {"fastcrc", *found.split()}


def test_what_pip_builds_of_the_copies_runs_the_meter(instructions: list[tuple[str, str]], tmp_path: Path) -> None:
    """Wheels of the copied files hold all that the meter imports and the files of its page."""
    builder = pytest.importorskip("hatchling.builders.wheel").WheelBuilder
    for name, said in instructions:
        *sources, to = said.split()
        if name == "COPY" and "requirements.txt" not in said and to.startswith("/build/"):
            for source in sources:
                place = tmp_path / to.lstrip("/") / (Path(source).name if to.endswith("/") else "")
                place.parent.mkdir(parents=True, exist_ok=True)
                copy = shutil.copytree if (ROOT / source).is_dir() else shutil.copy
                copy(ROOT / source, place)
    installs = next(said for name, said in instructions if name == "RUN" and "rm -rf /build" in said)
    for folder in re.findall(r" (/build\S*)", installs.partition("&&")[0]):
        (wheel,) = builder(str(tmp_path / folder.lstrip("/"))).build(directory=str(tmp_path), versions=["standard"])
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(tmp_path / "site")
    craft = FOLDER / "craft" / "bluerov2-heavy.json"
    found = bare(
        "from pathlib import Path\n"
        "from wakewise_ardusub.vehicle_summary import read_vehicle_summary\n"
        "from wakewise_ardusub.wash_meter.embedded import main\n"
        "from wakewise_ardusub.wash_meter.server import PAGE\n"
        "print(read_vehicle_summary(Path(sys.argv[1])).name, PAGE, *sorted(path.name for path in PAGE.iterdir()))",
        str(craft),
        sources=[tmp_path / "site"],
    ).split()
    assert found[0] == "bluerov2-heavy"
    assert Path(found[1]).is_relative_to(tmp_path / "site")
    assert {"index.html", "meter.js", "past.js", "meter.css"} <= set(found[2:])


@pytest.mark.parametrize("name", ["bluerov2", "bluerov2-heavy"])
def test_its_craft_files_are_the_librarys_vehicles(name: str) -> None:
    """Number for number (`tools/write_blueos.py` writes them), and light enough for a small computer."""
    kept, now = (
        read_vehicle_summary(FOLDER / "craft" / f"{name}.json"),
        VehicleSummary.of(load_vehicle(name), wake_model("jet")),
    )
    assert (kept.name, kept.thrusters) == (now.name, now.thrusters)
    for field in ("allocation_matrix", "positions_B_m", "axes_B", "areas_m2", "thrust_lower_N", "thrust_upper_N"):
        assert getattr(kept, field) == pytest.approx(getattr(now, field), rel=1e-12), field
    assert kept.curve is not None
    assert now.curve is not None
    pulses = np.linspace(1100.0, 1900.0, 99)
    assert kept.curve.thrust_N(pulses, 15.0) == pytest.approx(now.curve.thrust_N(pulses, 15.0), rel=1e-12)
    assert WashSavingsCalculator.is_small(kept)


def test_its_logos_are_as_they_are_drawn() -> None:
    """By `tools/write_blueos.py`."""
    image = pytest.importorskip("PIL.Image")
    drawn = module(ROOT / "tools" / "write_blueos.py").logos()
    assert set(drawn) == {path.name for path in FOLDER.glob("*.png")}
    for name, picture in drawn.items():
        with image.open(FOLDER / name) as kept:
            assert np.array_equal(np.asarray(kept), picture), name


def test_the_store_is_told_of_it() -> None:
    """Name, image, page, and a description of a line."""
    told = json.loads((FOLDER / "metadata.json").read_text(encoding="utf-8"))
    assert set(told) == {"name", "website", "docker", "description"}
    assert all(told.values())
    assert "never commands" in told["description"]


@pytest.mark.parametrize(("owner", "code"), [("", 2), ("OWNER", 2), ("Reef Lab", 2), ("reef-lab", 0)])
def test_nothing_is_built_without_who_publishes_it(
    instructions: list[tuple[str, str]], tmp_path: Path, owner: str, code: int
) -> None:
    """The image's first step and the store's files refuse the placeholder, in a line that says what is needed."""
    assert instructions[1] == ("ARG", "OWNER")
    name, step = instructions[2]
    assert name == "RUN"
    ran = subprocess.run(["sh", "-c", step], env={"OWNER": owner, "PATH": "/bin"}, capture_output=True, check=False)
    assert ran.returncode == code
    tool = module(ROOT / "tools" / "write_blueos.py")
    if code:
        assert b"OWNER=ACCOUNT is needed" in ran.stderr
        with pytest.raises(ValueError, match="must be the account that publishes"):
            tool.write_store(owner, tmp_path / "store")
        assert not (tmp_path / "store").exists()
    else:
        tool.write_store(owner, tmp_path / "store")
        told = json.loads((tmp_path / "store" / "metadata.json").read_text(encoding="utf-8"))
        assert told["docker"] == "reef-lab/wakewise-wash-meter"
        assert "OWNER" not in json.dumps(told)
        assert len(list((tmp_path / "store").glob("*.png"))) == 2


def test_the_environment_becomes_options(tmp_path: Path) -> None:
    """Its own vehicle by default, one of /data by name, parameters where they lie; what cannot be is said at once."""
    options = module(FOLDER / "entry.py").options
    chosen = options({}, tmp_path)
    assert chosen[1].endswith("craft/bluerov2-heavy.json")
    assert "--no-token" in chosen
    assert chosen[-1] == "--ask"
    (tmp_path / "mine.json").write_text("{}", encoding="utf-8")
    (tmp_path / "vehicle.params").write_text("MOT_1_DIRECTION,-1\n", encoding="utf-8")
    environment = {"WAKEWISE_VEHICLE": "mine", "WAKEWISE_AHEAD": "0.6", "WAKEWISE_OPTIONS": "--publish --system 2"}
    mine = options(environment, tmp_path)
    assert mine[1] == str(tmp_path / "mine.json")
    assert mine[mine.index("--params") + 1] == str(tmp_path / "vehicle.params")
    assert mine[-3:] == ["--publish", "--system", "2"]
    assert mine[mine.index("--ahead") + 1] == "0.6"
    ends = MeterSettings(connection=chosen[chosen.index("--connection") + 1]).ends
    assert (ends.way, ends.port) == ("udpin", 14770)
    assert str(ends.port) in (FOLDER / "README.md").read_text(encoding="utf-8")
