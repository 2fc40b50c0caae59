"""Shipped files by their names, and YAML files."""

from collections import Counter

import pytest
from pydrake.common.yaml import yaml_load_data

from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import SHIPPED, find_file, models_dir, named, shipped
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.run.scenario import load_scenario


def test_shipped_files_have_one_short_name():
    files = {x.stem: x for x in models_dir().rglob("*") if x.suffix in (".yaml", ".sdf", ".csv")}
    assert {name: find_file(name, *SHIPPED) for name in shipped(*SHIPPED)} == files
    assert set(Counter(name for kind in SHIPPED for name in shipped(kind)).values()) == {1}
    for path in ("", "own.yaml", "folder/leans", "package://sdt/sdt.sdf", "sdt"):
        assert named(path, "motion") == path


# --- --set ----------------------------------------------------------------------------------------


def test_set_acts_as_in_the_file_with_paths_from_here(tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "run.yaml").write_text(
        "{robot: its.sdf, controller: {omega_r: 60, zeta: [1, 1]}, plant: }"
    )
    monkeypatch.chdir(tmp_path)
    changes = {"controller.kind": "pi_ctc", "controller.zeta[2]": 0.9, "motion": "leans"}
    changes |= {"device": {"catalogue": "mine.yaml"}, "plant.deviation.inertia_scale": 2}
    changed = load_scenario("sub/run.yaml", changes)
    (tmp_path / "whole.yaml").write_text("""\
{name: run, robot: sub/its.sdf, motion: leans, device: {catalogue: mine.yaml},
 plant: {deviation: {inertia_scale: 2}}, controller: {kind: pi_ctc, omega_r: 60, zeta: [1, .9]}}
""")
    assert changed == load_scenario("whole.yaml")
    assert changed.robot == f"{tmp_path}/sub/its.sdf"
    assert changed.device.catalogue == f"{tmp_path}/mine.yaml"


SET = [
    ("controller.kind=p_p", "--set controller.kind: 'p_p', expected one of pi, "),
    ("controller.zeta=[1]", "--set controller.zeta: 1 value(s), expected 4"),
    ("controller.kp[1]=1", "the list has no entries, expected the whole list"),
    ("controllr.kind=pi", "controllr: no such field, did you"),
    ("motion=nowhere.yaml", "ships) (with --set motion)"),
    ("name", "--set: 'name', expected FIELD=VALUE"),
    ("motion.first=x", "--set motion.first: expected the dotted name of a field"),
]


@pytest.mark.parametrize(("change", "words"), SET)
def test_set_is_checked_like_a_file(refuse, change, words):
    refuse("simulate", "../given/run.yaml", "--set", change, saying=[words])


# --- yaml at the boundary --------------------------------------------------------------------

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
    "a number of many digits": (
        f"name: {'1' * 5000}",
        "line 1: name: '1{40}' cannot be read as !!int",
    ),
    "half a letter": ('name: "a\\ud800b"', "line 1: name: control characters in a text"),
    "an escape": ('"\\e[31m": 1', "line 1: control characters in a text"),
    "yes": ("name: a\nyes: 1\n", "line 2: the key yes is no text in YAML"),
    "a list": ("? [a]\n: 1\n", "line 1: the key of several values is no text"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_yaml_is_refused(tmp_path, text, message):
    (tmp_path / "file.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"file\.yaml: {message}"):
        read_yaml(tmp_path / "file.yaml")


def test_yaml_is_read_as_drake_does(tmp_path):
    text = "a: &a {x: [1, 2], y: 1e3}\nb: {<<: *a, y: *a}\nc: {<<: [*a, {x: 3, z: 4}], y: 5}\n"
    text += (
        "_hidden: !Kind {x: .inf}\nd: [~, true, 0x10, -1, 1.5]\ne: |\n  two\tparts\n  and lines\n"
    )
    (tmp_path / "file.yaml").write_text(text, encoding="utf-8")
    assert read_yaml(tmp_path / "file.yaml") == yaml_load_data(text)
