"""Problems of an input as data: where, place, what was found, and what would be right."""

from __future__ import annotations

import pickle

import pytest

from sdt_drake.io.errors import InputError, Problem, at, retelling, within
from sdt_drake.io.fields import check
from sdt_drake.robot.device import Drive
from sdt_drake.run.scenario import load_scenario


def refused(make):
    with pytest.raises(InputError) as error:
        make()
    return error.value


def test_problems_of_a_file_are_told_one_by_one(tmp_path):
    file = tmp_path / "run.yaml"
    file.write_text("controler: {}\nperiod: -1\ncontroller: {omega_r: 60, zeta: [1, x]}\n")
    error = refused(lambda: load_scenario(file))
    assert [(x.place, x.where) for x in error.problems] == [
        (place, f"{file}") for place in ("period", "controller.zeta[2]", "controler")
    ]
    period, zeta, unknown = error.problems
    assert unknown.near == ("controller",)
    assert (period.found, period.accepted) == ("-1", "a number > 0 [s]")
    assert (zeta.found, zeta.accepted) == ("'x'", "a number > 0")
    assert error.lines == f"{error}".splitlines() == [
        f"{file}: period: -1, expected a number > 0 [s]",
        f"{file}: controller.zeta[2]: 'x', expected a number > 0",
        f"{file}: controler: no such field, did you mean 'controller'?",
    ]  # fmt: skip


def test_rules_between_fields_have_a_place():
    (problem,) = refused(lambda: check(Drive(n1=[1.0]), "drive.yaml")).problems
    assert problem == Problem(
        "missing, expected n1 and n0 or neither", place="n0", where="drive.yaml"
    )


def test_places_and_names_are_put_around_problems():
    def fail():
        with within("a.yaml"), within("a.yaml"), at("plant"), at("friction"):
            raise InputError("too large", place="[2]")

    assert refused(fail).problems == (
        Problem("too large", place="plant.friction[2]", where="a.yaml"),
    )
    assert f"{refused(fail)}" == "a.yaml: plant.friction[2]: too large"


def test_problems_may_be_changed_and_sent_to_another_process():
    class OwnError(InputError):
        pass

    def fail():
        with retelling(lambda problem: problem._replace(place="--period")):
            raise OwnError("-1, expected more", place="period")

    error = refused(fail)
    assert type(error) is OwnError and f"{error}" == "--period: -1, expected more"
    plain = InputError(*error.problems)
    assert pickle.loads(pickle.dumps(plain)).problems == plain.problems == error.problems
