"""Names of what ships, everywhere the same, and fields of a scenario changed on the way in."""

from collections import Counter

import pytest

from sdt_drake.io.resources import SHIPPED, find_file, models_dir, named, shipped
from sdt_drake.run.scenario import load_scenario


def test_every_file_that_ships_has_one_short_name():
    files = {x.stem: x for x in models_dir().rglob("*") if x.suffix in (".yaml", ".sdf", ".csv")}
    assert {name: find_file(name, *SHIPPED) for name in shipped(*SHIPPED)} == files
    assert set(Counter(name for kind in SHIPPED for name in shipped(kind)).values()) == {1}
    for path in ("", "own.yaml", "folder/leans", "package://sdt/sdt.sdf", "sdt"):
        assert named(path, "motion") == path


# --- --set ----------------------------------------------------------------------------------------


def test_changes_are_as_in_the_file_but_paths_start_where_we_are(tmp_path, monkeypatch):
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
    ("controller.kp[1]=1", "the file has no entries there, expected the whole list"),
    ("controllr.kind=pi", "controllr: no such field, did you"),
    ("motion=nowhere.yaml", "ships) (with --set motion)"),
    ("name", "--set: 'name', expected FIELD=VALUE"),
    ("motion.first=x", "--set motion.first: expected the dotted name of a field"),
]


@pytest.mark.parametrize(("change", "words"), SET)
def test_set_is_checked_like_a_file(refuse, change, words):
    refuse("simulate", "../given/run.yaml", "--set", change, saying=[words])
