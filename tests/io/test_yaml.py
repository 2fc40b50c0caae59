"""YAML that is written: values by dotted names, in texts whose comments stay."""

import pytest

from sdt_drake.io.yaml_files import parse_yaml, with_comments, with_values, yaml_text
from sdt_drake.motion.segments import Turn

TEXT = """# head
name: ''  # of it
inner:
  list: []  # each
  # kept: 1
last: 5.0  # s
"""
TURN = {"_tag": "!Turn", "at": 1.0, "to_deg": 3.0, "duration": 2.0, "blend": "cosine"}
VALUES = [
    {"name": "a: #b", "last": 2.5e-7},
    {"inner.list": ["", "it's", "yes"], "name": "yes"},
    {"inner.list": [0.1] * 60},
    {"inner.list": [{"a": [1, 2], "b": {"c": "d"}}, {"a": []}]},
    {"inner.list": [TURN, {"one": [TURN]}]},
]


@pytest.mark.parametrize("values", VALUES)
def test_written_yaml_is_read_back_with_comments(values):
    text = with_values(TEXT, values)
    given = {"name": "", "inner": {"list": []}, "last": 5.0}
    for name, value in values.items():
        (given["inner"] if "." in name else given)[name.rpartition(".")[2]] = value
    assert parse_yaml(text) == given
    lines = text.splitlines()
    assert lines[0] == "# head" and "  # kept: 1" in lines and lines[-1].endswith("  # s")
    assert sum("# each" in line and line.startswith("  list:") for line in lines) == 1


def test_yaml_comments_change_no_value():
    thing = {"a": [Turn(at=1.0, to_deg=3.0, duration=2.0), [1.0, 2.0]], "b": "c"}
    text = yaml_text(thing, comments={"": "one\ntwo", "a[1]": "of\nit", "b": "last"})
    assert parse_yaml(text) == {"a": [TURN, [1.0, 2.0]], "b": "c"}
    assert text.startswith("# one\n# two\na:\n- !Turn {") and text.endswith("b: c  # last\n")
    assert "}  # of it\n" in text and with_comments(text, {}) == text
