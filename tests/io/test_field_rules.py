"""The check of fields: its laws on a small dataclass, and the rules of a scenario."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import (
    EachJoint,
    EachJointOrNone,
    FileOf,
    Input,
    Number,
    Positive,
    Tagged,
    Text,
    check,
    made,
    setting,
)
from sdt_drake.robot.device import Drive
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.scenario import Scenario, load_scenario, with_fields

FILE = Path("/runs/file.yaml")


@dataclass(slots=True)
class Circle(Input):
    """A circle."""

    radius: Positive = setting(unit="m")


@dataclass(slots=True)
class Square(Input):
    """A square."""

    side: Number = 1.0


@dataclass(slots=True)
class Drawing(Input):
    """Every kind of field."""

    name: str = ""
    file: Annotated[Text, FileOf("anything")] = "package://sdt/a"
    size: Number = setting(1.0, ge=0, le=10)
    count: int = setting(1, ge=1)
    filled: bool = False
    place: list[Number] = setting([0.0, 0.0], min_length=2, max_length=2)
    widths: EachJoint[Positive] | None = None
    labels: EachJointOrNone[str] = setting([])
    shapes: list[Annotated[Circle | Square, Tagged()]] = setting([])
    frame: Square = setting(Square)
    points: list[list[Number]] = setting([])

    def problems(self) -> Iterator[tuple[str, str]]:
        if self.filled and self.count > 1:
            yield "count", "one, of what is filled"
        if self.name == "raises":
            raise InputError("first", "second")


def refused(make, *lines):
    with pytest.raises(InputError) as error:
        make()
    assert error.value.lines == list(lines)


def test_a_file_becomes_an_object():
    data = {
        "name": "a", "file": "b", "size": "1e1", "count": 3, "place": [1, 2], "widths": [1],
        "shapes": [{"radius": 2}, {"_tag": "!Square", "side": 3}], "points": [[1], [2, 3]],
        "frame": None,
    }  # fmt: skip
    drawing = made(Drawing, data, FILE)
    assert drawing == Drawing(
        "a", "/runs/b", 10.0, count=3, place=[1.0, 2.0], widths=[1.0],
        shapes=[Circle(2.0), Square(3.0)], points=[[1.0], [2.0, 3.0]],
    )  # fmt: skip
    assert [type(x) for x in (drawing.size, *drawing.place)] == [float] * 3
    made(Drawing, {}, FILE).place[0] = 1.0
    assert made(Drawing, {}, FILE) == Drawing() and Drawing().place == [0, 0]


def test_all_that_is_wrong_is_told_at_once():
    data = {
        "nam": 1, "name": 2, "frame": {"side": [1], "depth": 3}, "shapes": [{}, {"_tag": "!Oval"}],
        "points": [[1, "a"]], "filled": "yes",
    }  # fmt: skip
    lines = (
        "name: 2, expected a text",
        "filled: 'yes', expected true or false",
        "shapes[1].radius: missing, expected a number > 0 [m]",
        "shapes[2]: unknown kind !Oval, expected !Circle, !Square",
        "frame.side: [1], expected a number",
        "frame.depth: no such field, expected one of side",
        "points[1][2]: 'a', expected a number",
        "nam: no such field, did you mean 'name'?",
    )
    refused(lambda: made(Drawing, data, FILE), *(f"/runs/file.yaml: {line}" for line in lines))
    many = [f"/runs/file.yaml: points[1][{k}]: 'a', expected a number" for k in range(1, 21)]
    whole = {"points": [["a"] * 30]}
    refused(lambda: made(Drawing, whole, FILE), *many, "/runs/file.yaml: 10 more")
    for data, found in ((None, "empty"), (3, "3"), ([1], "[1]"), ("text", "'text'")):
        with pytest.raises(InputError, match=f": {re.escape(found)}, expected a mapping with name"):
            made(Drawing, data, FILE)


BAD = [
    ({"size": -np.inf}, "size: -inf, expected a finite number >= 0 and <= 10"),
    ({"size": None}, "size: empty, expected a number >= 0 and <= 10"),
    ({"size": 10**400}, "size: a whole number of more than 64 bits, expected a number >= 0 and"),
    ({"count": True}, "count: True, expected a whole number >= 1"),
    ({"file": ""}, "file: empty, expected a text"),
    ({"place": [1]}, "place: 1 value(s), expected 2"),
    ({"place": []}, "place: empty, expected a list of numbers"),
    ({"widths": [1, 1, 1]}, "widths: 3 value(s), expected 4, one for each joint"),
    ({"widths": []}, "widths: empty, expected a list of numbers > 0, one for each joint"),
    ({"labels": ["a", "b", 3, "d"]}, "labels[3]: 3, expected a text"),
    ({"frame": None}, "frame: empty, expected a Square"),
    ({"shapes": [Circle(0)]}, "shapes[1].radius: 0, expected a number > 0 [m]"),
    ({"shapes": [Drive()]}, "shapes[1]: Drive("),
    ({"filled": True, "count": 2}, "count: one, of what is filled"),
]


@pytest.mark.parametrize(("values", "line"), BAD, ids=[line[:40] for _, line in BAD])
def test_bad_values_of_an_object_of_python(values, line):
    with pytest.raises(InputError, match=f"^drawing: {re.escape(line)}.*$"):
        check(Drawing(**values), "drawing", n=4)


def test_numbers_and_lists_of_numpy_will_do_and_lengths_wait_for_the_robot():
    drawing = Drawing(size=np.float64(2), count=np.int64(3), place=np.zeros(2), widths=(1.0, 2.0))
    check(drawing)
    check(drawing, n=2)
    refused(lambda: check(drawing, n=3), "widths: 2 value(s), expected 3, one for each joint")


def test_rules_between_fields_may_raise_and_wait_for_the_fields():
    refused(lambda: check(Drawing(name="raises"), "a"), "a: first", "a: second")
    refused(
        lambda: check(Drawing(name="raises", count=0)), "count: 0, expected a whole number >= 1"
    )


# --- a scenario ------------------------------------------------------------------------------


def axis(**fields) -> Scenario:
    return with_fields(load_scenario("package://sdt/scenarios/axis_pi.yaml"), fields)


def coupled(kind: str, fields: dict) -> Scenario:
    base = load_scenario("package://sdt/scenarios/coupled_pi.yaml")
    return with_fields(base, {"controller.kind": kind, **fields})


# What numbers and names alone are taken: test_every_field.
AXIS = [
    ({"controller.kp": [1.0] * 3}, "controller.kp: 3 value(s), expected 4, one for each joint"),
    ({"plant.friction.breakaway": [0, 0, 1.0, 1], "plant.friction.coulomb": [0, 0, 1.0, 1.1]},
     "plant.friction.breakaway: [0.0, 0.0, 1.0, 1.0], expected at least coulomb, [0.0, 0.0, 1.0"),
    ({"device.motors": ["AC-203"], "device.fitted": [""] * 4}, "device.motors: 1 value(s), expect"),
    ({"device.motors": ["AC-203"] * 4}, "device.fitted: missing; for each joint, name the motor"),
    ({"drive.period": 0.002}, "drive.period: 0.002, does not divide the interpolation period"),
    ({"drive.encoder_resolution": [1e6] * 4}, "drive.encoder_resolution: needs period, to comput"),
    ({"drive.n0": [1.0] * 4}, "drive.n1: missing, expected n1 and n0 or neither"),
    ({"drive.n1": [1.0, 2, 3, 4], "drive.n0": [2.0, 3, 3, 5]},
     "drive.n0: [2.0, 3.0, 3.0, 5.0], expected more than n1, [1.0, 2.0, 3.0, 4.0], everywhere"),
    ({"controller.file": "/no/file.py"}, "controller: /no/file.py: no such file"),
    ({"controller.kind": "inverse_dynamics"}, "controller.kind: inverse_dynamics needs plant.kind"),
    ({"controller.kp": None}, "controller.kp: missing, expected kp and ki or neither"),
    *(
        ({f"controller.{name}": value}, f"controller.{name}: kp and ki are given; remove one or")
        for name, value in (("omega_r", 60.0), ("omega_ratio", 0.4), ("zeta", [1.0] * 4))
    ),
]  # fmt: skip


@pytest.mark.parametrize(("fields", "line"), AXIS, ids=[line for _, line in AXIS])
def test_a_bad_field_of_a_scenario(fields, line):
    with pytest.raises(InputError, match=f"^run: {re.escape(line)}.*$") as error:
        check(axis(**fields), "run", n=4)
    assert len(error.value.problems) == 1


OPEN = ("p_pi", "pi_scheduled")  # kinds that leave the feedforward to the scenario
FIXED = tuple(kind for kind in CONTROLLERS if kind not in OPEN)
OPTIONS = [
    (CONTROLLERS, {"controller.omega_r": None}, "omega_r: missing, the gains need it, or kp and"),
    (CONTROLLERS, {"controller.friction_compensation": True}, "friction_compensation: needs pla"),
    (FIXED, {"controller.feedforward": "none"}, "feedforward: {} takes none, only p_pi, pi_sch"),
    (OPEN, {"controller.feedforward": "full"}, "feedforward: 'full', expected one of none, ctc, "),
    ([kind for kind in CONTROLLERS if kind != "p_pi"], {"controller.position_gain": [1.0] * 4},
     "position_gain: {} takes none, only p_pi"),
    (["pi", "inverse_dynamics", *OPEN], {"controller.feedforward_gain": [1.0] * 4},
     "feedforward_gain: {} has no feedforward"),
    (["inverse_dynamics"], {"controller.anti_windup": True},
     "anti_windup: inverse_dynamics takes none, only pi, pi_ctc, pi_id, p_pi, pi_scheduled"),
    (CONTROLLERS, {"plant.i_eff": [1.0] * 4}, "i_eff: the coupled plant has its inertia from the"),
]  # fmt: skip


@pytest.mark.parametrize(("kinds", "fields", "line"), OPTIONS)
def test_what_the_kind_of_controller_or_plant_would_not_use(kinds, fields, line):
    part = next(iter(fields)).partition(".")[0]
    for kind in kinds:
        check(coupled(kind, {}), n=4)
        with pytest.raises(InputError, match=f"^{part}.{re.escape(line.format(kind))}.*$"):
            check(coupled(kind, fields), n=4)


def test_every_other_kind_is_for_the_axis_plant():
    for kind in {*CONTROLLERS} - {"inverse_dynamics"}:
        check(axis(**{"controller.kind": kind}))


def test_whole_fractions_of_the_interpolation_period_are_taken():
    # 5 ms / 3 is no short decimal, 0.3 ms / 3 is no whole binary multiple.
    for period, divisor in ((0.005, 3), (0.005, 40), (0.007, 7), (1 / 300, 3), (0.012, 40)):
        check(axis(period=period, **{"drive.period": period / divisor}))
