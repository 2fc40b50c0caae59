"""YAML at the boundary: large, deep and odd texts are refused before they cost anything."""

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.io.yaml_files import read_yaml

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n"
for old, new in ("ab", "bc", "cd", "de", "ef", "fg", "gh", "hi"):
    BOMB += f"{new}: &{new} [{', '.join(9 * ['*' + old])}]\n"
BAD = {
    "deep": ("zeta: " + "[" * 900_000, "too large, expected at most 200000 values and 50 levels"),
    "aliases of aliases": (BOMB, "too large, expected at most 200000 values and 50 levels"),
    "an alias of itself": ("name: &a [*a]\n", "too large"),
    "a tag on a list": ("name: !Spline [1]\n", "line 1: name: !Spline on a list"),
    "twice below": ("a: [{b: 1, b: 2}]\n", r"line 1: a\[1\]\.b: is given twice"),
    "merged text": ("a: &a x\nname: {<<: *a}\n", "line 2: name.<<: expected a mapping to merge"),
    "long": ("#" * 1_000_001, "1000001 bytes, expected at most 1000000"),
    "a long text": (f"name: {'x' * 10_001}", "line 1: name: 10001 characters, expected at most"),
    "a number of many digits": (f"name: {'1' * 5000}", "not valid YAML"),
    "half a letter": ('name: "a\\ud800b"', "line 1: name: control characters in a text"),
    "an escape": ('"\\e[31m": 1', "line 1: control characters in a text"),
    "yes": ("name: a\nyes: 1\n", "line 2: the key yes is no text in YAML"),
    "a list": ("? [a]\n: 1\n", "line 1: the key of several values is no text"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_refused(tmp_path, text, message):
    (tmp_path / "file.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"file\.yaml: {message}"):
        read_yaml(tmp_path / "file.yaml")
