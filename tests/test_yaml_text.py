"""YAML: what is written twice is refused where it stands, and what looks like a time is no number."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.yaml_text import YamlError, read_yaml


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
