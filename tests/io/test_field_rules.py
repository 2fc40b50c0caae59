"""The check of fields: its laws on a small dataclass, and the rules of a scenario."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

from sdt_drake.io import fields as f
from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Drive
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.scenario import load_scenario, with_fields

FILE = Path("/runs/file.yaml")


@dataclass(slots=True)
class Circle(f.Input):
    """A circle."""

    radius: f.Positive = f.setting(unit="m")


@dataclass(slots=True)
class Square(f.Input):
    """A square."""

    side: f.Number = 1.0


@dataclass(slots=True)
class Drawing(f.Input):
    """Every kind of field."""

    name: str = ""
    file: Annotated[f.Text, f.FileOf("anything")] = "package://sdt/a"
    size: f.Number = f.setting(1.0, ge=0, le=10)
    count: int = f.setting(1, ge=1)
    widths: f.EachJoint[f.Positive] | None = None
    shapes: list[Annotated[Circle | Square, f.Tagged()]] = f.setting([])
    frame: Square = f.setting(Square)
    points: list[list[f.Number]] = f.setting([])

    def problems(self) -> Iterator[tuple[str, str]]:
        if self.size == 0 and self.count > 1:
            yield "count", "one, of what has no size"
        if self.name == "raises":
            raise InputError("first", "second")


def test_a_file_becomes_an_object():
    data = {
        "name": "a", "file": "b", "size": "1e1", "count": 3, "widths": [1], "frame": None,
        "shapes": [{"radius": 2}, {"_tag": "!Square", "side": 3}], "points": [[1], [2, 3]],
    }  # fmt: skip
    drawing = f.made(Drawing, data, FILE)
    shapes = [Circle(2.0), Square(3.0)]
    assert drawing == Drawing("a", "/runs/b", 10.0, 3, [1.0], shapes, points=[[1.0], [2.0, 3.0]])
    assert [type(x) for x in (drawing.size, *drawing.points[1])] == [float] * 3
    f.made(Drawing, {}, FILE).shapes.append(Circle(2.0))
    assert f.made(Drawing, {}, FILE) == Drawing() and Drawing().shapes == []


WRONG = {
    "nam": 1, "name": 2, "frame": {"side": [1], "depth": 3}, "shapes": [{}, {"_tag": "!Oval"}],
    "points": [[1, "a"]],
}  # fmt: skip
TOLD = [
    "name: 2, expected a text",
    "shapes[1].radius: missing, expected a number > 0 [m]",
    "shapes[2]: unknown kind !Oval, expected !Circle, !Square",
    "frame.side: [1], expected a number",
    "frame.depth: no such field, expected one of side",
    "points[1][2]: 'a', expected a number",
    "nam: no such field, did you mean 'name'?",
]
MANY = [*(f"points[1][{k}]: 'a', expected a number" for k in range(1, 21)), "10 more"]
MAPPING = "expected a mapping with name, file, size, count, widths, shapes, frame, points"
ALL = [(WRONG, TOLD), ({"points": [["a"] * 30]}, MANY)]
ALL += [(None, [f"empty, {MAPPING}"]), ([1], [f"[1], {MAPPING}"]), ("a", [f"'a', {MAPPING}"])]


@pytest.mark.parametrize(("data", "lines"), ALL)
def test_all_that_is_wrong_is_told_at_once(data, lines):
    with pytest.raises(InputError) as error:
        f.made(Drawing, data, FILE)
    assert error.value.lines == [f"/runs/file.yaml: {line}" for line in lines]


BAD = [
    ({"size": -np.inf}, "size: -inf, expected a finite number >= 0 and <= 10"),
    ({"size": 10**400}, "size: a whole number of more than 64 bits, expected a number >= 0 and"),
    ({"widths": [1, 1, 1]}, "widths: 3 value(s), expected 4, one for each joint"),
    ({"widths": []}, "widths: empty, expected a list of numbers > 0, one for each joint"),
    ({"frame": None}, "frame: empty, expected a Square"),
    ({"shapes": [Circle(0)]}, "shapes[1].radius: 0, expected a number > 0 [m]"),
    ({"shapes": [Drive()]}, "shapes[1]: Drive("),
    ({"size": 0, "count": 2}, "count: one, of what has no size"),
    ({"name": "raises"}, "first\ndrawing: second"),
    ({"name": "raises", "count": 0}, "count: 0, expected a whole number >= 1"),  # before rules
]


@pytest.mark.parametrize(("values", "line"), BAD, ids=[line[:40] for _, line in BAD])
def test_bad_values_of_an_object_of_python(values, line):
    with pytest.raises(InputError, match=f"^drawing: {re.escape(line)}.*$"):
        f.check(Drawing(**values), "drawing", n=4)


def test_python_may_assign_what_fits_a_field():
    drawing = Drawing(size=np.float64(2), count=np.int64(3), widths=np.ones(2))
    f.check(drawing)  # the count of joints waits for the robot
    f.check(drawing, n=2)
    with pytest.raises(AttributeError, match="no field 'widht', did you mean 'widths'"):
        drawing.widht = [1.0]


# --- a scenario ------------------------------------------------------------------------------


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


def scenario(name, fields):
    return with_fields(load_scenario(name), fields)


@pytest.mark.parametrize(("fields", "line"), AXIS, ids=[line for _, line in AXIS])
def test_a_bad_field_of_a_scenario(fields, line):
    with pytest.raises(InputError, match=f"^run: {re.escape(line)}.*$") as error:
        f.check(scenario("axis_pi", fields), "run", n=4)
    assert len(error.value.problems) == 1


OPEN = ("p_pi", "pi_scheduled")  # kinds that leave the feedforward to the scenario
FIXED = tuple(kind for kind in CONTROLLERS if kind not in OPEN)
OPTIONS = [
    (CONTROLLERS, "controller.omega_r", None, "missing, the gains need it, or kp and"),
    (CONTROLLERS, "controller.friction_compensation", True, "needs pla"),
    (FIXED, "controller.feedforward", "none", "{} takes none, only p_pi, pi_sch"),
    (OPEN, "controller.feedforward", "full", "'full', expected one of none, ctc, "),
    ([*FIXED, "pi_scheduled"], "controller.position_gain", [1.0] * 4, "{} takes none, only p_pi"),
    (["pi", "inverse_dynamics", *OPEN], "controller.feedforward_gain", [1.0] * 4,
     "{} has no feedforward"),
    (["inverse_dynamics"], "controller.anti_windup", True,
     "inverse_dynamics takes none, only pi, pi_ctc, pi_id, p_pi, pi_scheduled"),
    (CONTROLLERS, "plant.i_eff", [1.0] * 4, "the coupled plant has its inertia from the"),
]  # fmt: skip


@pytest.mark.parametrize(("kinds", "field", "value", "line"), OPTIONS)
def test_what_the_kind_of_controller_or_plant_would_not_use(kinds, field, value, line):
    for kind in kinds:
        fields = {"controller.kind": kind}
        f.check(scenario("coupled_pi", fields), n=4)
        with pytest.raises(InputError, match=f"^{field}: {re.escape(line.format(kind))}.*$"):
            f.check(scenario("coupled_pi", fields | {field: value}), n=4)


def test_every_other_kind_is_for_the_axis_plant():
    for kind in {*CONTROLLERS} - {"inverse_dynamics"}:
        f.check(scenario("axis_pi", {"controller.kind": kind}))


def test_whole_fractions_of_the_interpolation_period_are_taken():
    # 5 ms / 3 is no short decimal, 0.3 ms / 3 is no whole binary multiple.
    for period, divisor in ((0.005, 3), (0.005, 40), (0.007, 7), (1 / 300, 3), (0.012, 40)):
        f.check(scenario("axis_pi", {"period": period, "drive.period": period / divisor}))
