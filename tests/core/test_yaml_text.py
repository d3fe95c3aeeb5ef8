"""YAML: what is written twice is refused where it stands, and what looks like a time is no number."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, read_yaml, yaml_file
from wakewise.experiments.campaigns.definition import check_campaign, load_campaign
from wakewise.operation import Scenario
from wakewise.robot.vehicles.library import load_draft


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("seed: 1\nname: a\nseed: 2\n", 3, "key seed given more than once"),
        ("mission:\n  views: [3]\n  speed_m_s: 1\n  views: [4]\n", 4, "key views given more than once"),
        ("a: {b: 1, b: 2}", 1, "key b given more than once"),
        ("a: [1, 2", 1, "expected"),
        ("a: !!python/object/apply:os.system [ls]", 1, "constructor"),
        ("[" * 5000, None, "too deep"),
        ("a: 2024-13-45", None, "month"),
        ("mission: &m {views: *m}", None, "within what it refers to"),
        ("a: &x [1, {b: [*x]}]", None, "within what it refers to"),
        ("&top\na: {b: *top}", None, "within what it refers to"),
        ("a: 1\nseed: 0b" + "1" * 300_000, 2, "a number of 300002 digits, at most 100"),
        ("seed: " + "9" * 101, 1, "a number of 101 digits"),
        ("a: " + "x" * 4_000_000, None, "at most 4"),
    ],
)
def test_a_fault_names_its_line(text: str, line: int | None, words: str) -> None:
    """A key given twice, broken brackets, tags, depth: each is one line with the place where it can be known."""
    with pytest.raises(YamlError) as caught:
        read_yaml(text)
    assert words in caught.value.reason
    assert "\n" not in str(caught.value)
    assert caught.value.line == line


def test_a_time_is_no_number() -> None:
    """12:30 and -1:30.5 stay text instead of turning into 750 and -90.5; numbers and the same key elsewhere pass."""
    assert read_yaml("a: [12:30, -1:30.5, 1230, -1.5, 1_000]") == {"a": ["12:30", "-1:30.5", 1230, -1.5, 1000]}
    assert read_yaml("a: {x: 1}\nb: {x: 2}") == {"a": {"x": 1}, "b": {"x": 2}}


@pytest.mark.parametrize("suffix", [".yaml", ".csv"])
def test_a_file_that_is_too_large_is_not_read_whole(suffix: str, tmp_path: Path) -> None:
    """Not even one without an end: four megabytes are read of it, and the message quotes none of them."""
    path = tmp_path / f"long{suffix}"
    with path.open("wb") as file:
        file.truncate(50_000_000_000)  # takes no room
    for read in (yaml_file, load_campaign, Scenario.load, lambda path: load_draft(str(path))):
        with pytest.raises(InputError, match="larger than 4 MB") as told:
            read(path)
        assert len(str(told.value)) < 300


def test_messages_quote_the_beginning_of_what_is_long(tmp_path: Path) -> None:
    """A name of a million letters, and a seed that a program gives of more digits than Python writes."""
    path = tmp_path / "long.yaml"
    path.write_text("name: " + "a" * 1_000_000)
    for read in (Scenario.load, load_campaign):
        with pytest.raises(InputError, match="name: found 'aaaa") as told:
            read(path)
        assert len(str(told.value)) < 300
    for seed in (2**63, 2**20_000):
        for field in ("seed", "target.seed"):
            with pytest.raises(InputError, match=f"{field}: found .*9223372036854775807") as told:
                Scenario.preset("quick", **{field: seed})
            assert len(str(told.value)) < 300
        with pytest.raises(InputError, match=r"seeds.*9223372036854775807"):
            check_campaign({"seeds": [1, seed]})
    assert Scenario.preset("quick", seed=2**63 - 1).seed == 2**63 - 1


def test_merges_and_aliases_still_work() -> None:
    """A key taken over by a merge may be given anew: it is not the same mapping's own twice."""
    assert read_yaml("base: &b {x: 1, y: 2}\nmine: {<<: *b, y: 3}")["mine"] == {"x": 1, "y": 3}


@given(st.text(max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    """No text raises anything but `YamlError`."""
    try:
        read_yaml(text)
    except YamlError as fault:
        assert "\n" not in str(fault)
