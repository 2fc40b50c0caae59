"""YAML at the boundary: large, deep and odd texts are refused before they cost anything."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from sdt_drake.errors import InputError
from sdt_drake.yaml_files import load_yaml, read_yaml


@dataclass
class Schema:
    name: str = ""


BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join(9 * ['*' + old])}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)
BAD = {
    "aliases of aliases": (BOMB, "too large, expected at most 1000000 values and 50 levels"),
    "an alias of itself": ("name: &a [*a]\n", "too large"),
    "a mapping of itself": ("&a\nname: *a\n", "too large"),
    "deep": ("name: " + 51 * "[" + 51 * "]", "too large"),
    "very deep": ("name: " + 600 * "[" + 600 * "]", "too large"),
    "long": ("#" * 1_000_001, "1000001 bytes, expected at most 1000000"),
    "a long text": (f"a: 1\nname: {'x' * 10_001}", "line 2: 10001 letters, expected at most 10000"),
    "a number of many digits": (f"name: {'1' * 5000}", "not valid YAML"),
    "nul": ('name: "a\\0b"', "line 1: control characters in a text"),
    "half a letter": ('name: "a\\ud800b"', "line 1: control characters in a text"),
    "an escape": ('"\\e[31m": 1', "line 1: control characters in a text"),
    "yes": ("name: a\nyes: 1\n", "line 2: yes: no text to YAML, which takes yes, no, on and off"),
    "off": ("off: 1\n", "line 1: off: no text to YAML"),
    "a number": ("1: 1\n", "line 1: 1: no text to YAML"),
    "nothing": ("~: 1\n", "line 1: ~: no text to YAML"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(tmp_path, case):
    text, message = BAD[case]
    path = tmp_path / "file.yaml"
    path.write_text(text, encoding="utf-8")
    for load in (read_yaml, lambda path: load_yaml(Schema, path)):
        with pytest.raises(InputError, match=rf"file\.yaml(:|,) .*{message}"):
            load(path)


def test_aliases_and_merged_keys_are_read(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("a: &a {x: [1, 2]}\nb: {<<: *a, y: *a}\nc: |\n  two\tparts\n  and lines\n")
    assert read_yaml(path)["b"] == {"x": [1, 2], "y": {"x": [1, 2]}}
