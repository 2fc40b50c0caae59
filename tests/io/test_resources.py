"""Names of what ships, everywhere the same, and fields of a scenario changed on the way in."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest
from command_line import ENDS, RUN

from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import SHIPPED, find_file, models_dir, named, shipped
from sdt_drake.run.scenario import load_scenario


def test_every_file_that_ships_has_one_short_name():
    files = {x.stem: x for x in models_dir().rglob("*") if x.suffix in (".yaml", ".sdf", ".csv")}
    assert {name: find_file(name, *SHIPPED) for name in shipped(*SHIPPED)} == files
    assert set(Counter(name for kind in SHIPPED for name in shipped(kind)).values()) == {1}
    for path in ("", "own.yaml", "folder/leans", "package://sdt/sdt.sdf", "sdt"):
        assert named(path, "motion") == path


@pytest.mark.parametrize(
    ("text", "kinds", "message"),
    [
        ("graveyard_spn", ["motion"], "no such motion, did you mean 'graveyard_spin' or "),
        ("zzz", ["study"], "no such study; shipped: monte_carlo, sizing (looked in {cwd} and"),
        ("coupled_pi.yaml", ["scenario"], "no such file, did you mean 'coupled_pi' or "),
        ("given/mine", ["scenario"], "no such file, did you mean 'given/mine.yaml'? (looked in "),
        ("package://sdt/sdt.sd", [], "no such file, did you mean 'package://sdt/sdt.sdf'? (loo"),
    ],
)
def test_what_is_not_there_is_told_with_its_like(tmp_path, monkeypatch, text, kinds, message):
    (tmp_path / "given").mkdir()
    (tmp_path / "given" / "mine.yaml").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        InputError, match="^" + re.escape(f"{text}: {message}".format(cwd=tmp_path))
    ):
        find_file(text, *kinds)


# --- --set ----------------------------------------------------------------------------------------


def test_changes_are_as_in_the_file_but_paths_start_where_we_are(tmp_path, monkeypatch):
    (tmp_path / "run.yaml").write_text("controller: {omega_r: 60, zeta: [1, 1]}\nplant:\n")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    changed = load_scenario(
        "run.yaml",
        {
            "controller.kind": "pi_ctc",
            "controller.zeta[2]": 0.9,
            "plant.deviation.link_scales": [1, 2],
            "device": {"catalogue": "sub/mine.yaml"},
            "robot": "sub/mine.sdf",
            "motion": "leans",
        },
    )
    text = """\
robot: ../sub/mine.sdf
motion: leans
device: {catalogue: ../sub/mine.yaml}
plant: {deviation: {link_scales: [1, 2]}}
controller: {kind: pi_ctc, omega_r: 60, zeta: [1, 0.9]}
name: run
"""
    (tmp_path / "sub" / "whole.yaml").write_text(text)
    whole = load_scenario("sub/whole.yaml")
    assert {Path(x.robot).resolve() for x in (changed, whole)} == {tmp_path / "sub" / "mine.sdf"}
    changed.robot = whole.robot
    changed.device.catalogue = whole.device.catalogue = "sub/mine.yaml"
    assert changed == whole


def test_set_goes_into_the_run(good, desk, given):
    short = good("simulate", RUN, "--set", "controller.kind=p_pi", "--out", "a.csv").out
    assert short.startswith("run: p_pi on the coupled plant")
    text = ENDS["coupled"].replace("motion.yaml", "short.yaml")
    same = given("run2.yaml", text.replace("kind: pi,", "kind: p_pi,"))
    good("simulate", same, "--out", "b.csv")
    assert (desk / "a.csv").read_bytes() == (desk / "b.csv").read_bytes()
    good("view", RUN, "--set", "motion=../given/short.yaml", "--record", "a.html")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("controller.kind=p_p", ["--set controller.kind: 'p_p', expected one of pi, "]),
        ("controller.zeta=[1]", ["--set controller.zeta: 1 value(s), expected 4"]),
        ("controller.kp[1]=1", ["the file has no entries there, expected the whole list"]),
        ("controllr.kind=pi", ["controllr: no such field, did you", "(with --set controllr.kind)"]),
        ("plant.deviation.payload_mass=-999", ["--set plant.deviation.payload_mass: -999 kg"]),
        ("motion=nowhere", ["--set motion: nowhere: no such motion; shipped:"]),
        ("motion=nowhere.yaml", ["desk/nowhere.yaml: no such file", "(with --set motion)"]),
        ("name", ["--set: 'name', expected FIELD=VALUE"]),
        ("motion.first=x", ["--set motion.first: expected the dotted name of a field"]),
    ],
)
def test_set_is_checked_like_a_file(refuse, change, words):
    refuse("simulate", RUN, "--set", change, saying=words)
