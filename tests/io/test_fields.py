"""The check of fields: every one of every model by its schema, what is told of wrong ones, and the
rules of a scenario."""

import difflib
import importlib
import json
import math
import pickle
import pkgutil
import re
from collections.abc import Callable, Iterator
from dataclasses import FrozenInstanceError, dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import sdt_drake
from sdt_drake.io.errors import MAX_NUMBER, MAX_PROBLEMS, InputError
from sdt_drake.io.fields import Input, check_joints, made
from sdt_drake.io.names import given_fields, value_of
from sdt_drake.io.resources import models_dir
from sdt_drake.io.schema import Schema, inner, schema_of
from sdt_drake.io.shown import Shown
from sdt_drake.machine.learn.state import TrialRecord
from sdt_drake.motion.profile import Track
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import load_catalogue
from sdt_drake.run.controllers import CONTROLLERS
from sdt_drake.run.scenario import PlantChoice, Scenario, load_scenario
from sdt_drake.show.reference import FILES, SCHEMAS
from sdt_drake.studies.sizing import load_sizing

FILE = Path("/runs/file.yaml")
SIZING = """
{{scenario: coupled_pi, motors: [[AC-203], [TM-3950], [TM-2150], [TM-2150]], motions: [{motions}],
 controllers: [pi], requirements: {{max_abs_speed_error: [1]}}}}
"""


# --- every field -----------------------------------------------------------------------------


class Node(NamedTuple):
    """A field of a model: its dotted place, its schema, and how a value makes the model's data."""

    place: str
    schema: Schema
    data: Callable[[Any], Any]


COMMITTED = {
    model: json.loads((models_dir() / SCHEMAS / f"{topic}.json").read_text(encoding="utf-8"))
    for topic, model in FILES.items()
}
COMMITTED[TrialRecord] = schema_of(TrialRecord)
"""Schema of each kind of file, as editors are told it; a record, nobody edits."""


def nodes(model: type) -> Iterator[Node]:
    """All fields of a model, also those within others."""
    top = COMMITTED[model]

    def within(node: Schema, place: str, data: Callable[[Any], Any]) -> Iterator[Node]:
        for option in (one for one in node.get("anyOf", ()) if "$ref" in one):
            tag = {"_tag": "!" + option["$ref"].rpartition("/")[2]}
            yield from within(inner(option, top), place, lambda value, tag=tag: data(tag | value))
        node = inner(node, top)
        if "properties" not in node and {"type", "enum"} & set(node):
            yield Node(place, node, data)
        needs = node.get("else", {}).get("dependencies", {})
        for name, field in node.get("properties", {}).items():
            dotted = f"{place}.{name}".lstrip(".")
            kinds = needs.get(name, {}).get("properties", {})  # of controllers that take the field
            other = {kind: choices["enum"][0] for kind, choices in kinds.items()}
            yield from within(
                field, dotted, lambda value, name=name, other=other: data(other | {name: value})
            )
        if "items" in node:
            count = node.get("minItems", 1)
            yield from within(node["items"], f"{place}[1]", lambda value: data([value] * count))

    yield from within(top, "", lambda value: value)


def limits(schema: Schema) -> Iterator[tuple[float, float]]:
    """The last number that is taken at each bound, and the first that is not."""
    for name, bound in schema.items() if schema.get("type") in ("number", "integer") else ():
        if name.lower().endswith(("minimum", "maximum")):
            outwards = -math.inf if name.lower().endswith("minimum") else math.inf
            if schema["type"] == "integer":
                yield bound, bound + int(math.copysign(1, outwards))
            elif name.startswith("exclusive"):
                yield math.nextafter(bound, -outwards), bound
            else:
                yield bound, math.nextafter(bound, outwards)


def wrong_values(schema: Schema) -> list[Any]:
    """Values of other types and beyond limits, and lists that are too short or too long."""
    kind = schema.get("type", "string")
    if "enum" in schema:
        return ["no such choice", 3, True, [1.0], math.nan]
    if kind in ("number", "integer"):
        outside = [outer for _, outer in limits(schema)]
        broken = [1.5] * (kind == "integer")
        return [True, False, "1", "x", [1.0], math.nan, math.inf, -math.inf, *broken, *outside]
    if kind == "boolean":
        return [0, 1, "yes", "x", math.nan, [True]]
    if kind == "string":
        return [3, 1.5, True, math.nan, ["a"], *[""] * (schema.get("minLength", 0) > 0)]
    lists = [[]] * ("minItems" in schema) + [[1.0] * 9] * ("maxItems" in schema)
    return [3, True, math.nan, *["x"] * (kind == "array"), *lists]


def is_told(model: type, node: Node, value: Any) -> bool:
    """Once, in one line, with what is accepted."""
    try:
        made(model, node.data(value), FILE)
    except InputError as error:
        told = [f"{one}" for one in error.problems if one.place == node.place and one.accepted]
        return len(told) == 1 and "\n" not in told[0] and len(told[0]) < 500
    return False


@pytest.mark.parametrize("model", COMMITTED)
def test_every_field_checks_values_as_its_schema(model):
    validator = pytest.importorskip("jsonschema").Draft7Validator
    for node in nodes(model):
        wrong = wrong_values(node.schema)
        refused = [value for value in wrong if is_told(model, node, value)]
        assert repr(refused) == repr(wrong), node.place
        editor = validator({"$defs": COMMITTED[model].get("$defs"), **node.schema})
        taken = [x for x in wrong if editor.is_valid(x) and repr(x) not in ("nan", "inf", "-inf")]
        assert taken == [], node.place
        for last, _ in limits(node.schema):
            assert editor.is_valid(last) and not is_told(model, node, last), (node.place, last)


@pytest.mark.parametrize("model", COMMITTED)
def test_numbers_beyond_the_largest_are_refused(model):
    for node in nodes(model):
        kind = node.schema.get("type")
        if kind in ("number", "integer") and node.schema.get("maximum", 0) < MAX_NUMBER:
            for value in (2e16, -2e16) if kind == "number" else (2 * 10**16, 10**5000):
                assert is_told(model, node, value), node.place


# --- what is told ----------------------------------------------------------------------------


def changed(name, fields):
    made = load_scenario(name).changed(fields)
    check_joints(made, f"scenario '{name}'", 4)
    return made


def test_objects_take_any_sequence_and_are_immutable():
    kp = np.ones(4)
    fields = {"controller.kp": kp, "controller.ki": [1] * 4, "period": np.float64(0.01)}
    made = changed("axis_pi", fields)
    copies = load_scenario("axis_pi", fields), replace(made), pickle.loads(pickle.dumps(made))
    assert all(copy == made for copy in copies)
    kp[:] = 2
    assert made.controller.kp == made.controller.ki == (1.0,) * 4 and hash(made)
    load_scenario("axis_pi").changed({"controller.kp": [1.0]})  # their count waits for the robot
    for thing, name in ((made, "period"), (made.controller, "kp"), (made, "perod")):
        with pytest.raises(FrozenInstanceError):
            setattr(thing, name, 0.01)
    with pytest.raises(TypeError):
        made.controller.kp[0] = 2.0


def dataclasses_of_the_package() -> Iterator[type]:
    for found in pkgutil.walk_packages(sdt_drake.__path__, "sdt_drake."):
        if found.name != "sdt_drake.__main__":
            module = importlib.import_module(found.name)
            own = [x for x in vars(module).values() if isinstance(x, type)]
            own = [x for x in own if x.__module__ == found.name]
            yield from (x for x in own if "__dataclass_params__" in vars(x))


def test_models_of_files_are_frozen_and_objects_with_arrays_are_equal_to_themselves_alone():
    """numpy's == gives an array: dataclasses of arrays could not be compared or kept in sets."""
    models, with_arrays = [], []
    for kind in dataclasses_of_the_package():
        if issubclass(kind, Shown):
            assert kind.__repr__ is Shown.__repr__, kind  # its summary
        if issubclass(kind, Input):
            models.append(kind)
            assert kind.__dataclass_params__.frozen, kind
        elif any(re.search(r"Array\b|ndarray", str(field.type)) for field in fields(kind)):
            with_arrays.append(kind)
    assert len(models) > 50 and len(with_arrays) > 30
    assert [kind for kind in with_arrays if kind.__eq__ is not object.__eq__] == []


def names_of(thing, prefix=""):
    for name, value in given_fields(thing):
        is_model = isinstance(value, Input)
        yield from names_of(value, f"{prefix}{name}.") if is_model else [prefix + name]


@pytest.mark.parametrize("name", ["axis_pi", "real_device", "uncertain"])
def test_dotted_name_changes_its_field_alone(name):
    """All of them, so that one put anywhere else would be seen; a list by entries, too."""
    scenario, other = load_scenario(name), load_scenario("coupled_pi_ctc")
    for field in {*names_of(scenario), *names_of(other)} - {"controller.omega_r", "plant.i_eff"}:
        value = value_of(scenario, field)
        assert scenario.changed({field: value}) == scenario
        if isinstance(value, tuple) and value:
            last = f"{field}[{len(value)}]"
            assert scenario.changed({last: value_of(scenario, last)}) == scenario
    several = {"controller.kp": [1.0] * 4, "controller.ki": [1.0] * 4, "controller.kp[2]": 3.0}
    several |= dict.fromkeys(("controller.omega_r", "controller.zeta"))
    gains = scenario.changed(several | {"drive": {"period": 0.001}})
    assert gains.controller.kp == (1.0, 3.0, 1.0, 1.0) and gains.drive == Drive(period=0.001)
    rest = {field for field in names_of(gains) if not field.startswith(("controller.", "drive."))}
    assert all(value_of(gains, field) == value_of(scenario, field) for field in rest)


NO_NAMES = [
    ({"controller.kp[5]": 1.0}, "controller.kp[5]: the list has 4 entries, expected [1] to [4], o"),
    ({"drive.n0[1]": 1.0}, "drive.n0[1]: the list has no entries, expected the whole list"),
    ({"controller[1].kind": "pi"}, "controller[1].kind: expected the dotted name of a field"),
    ({"controller.zta": 1.0}, "controller.zta: no such field, did you mean 'zeta'?"),
    ({"controller.kp.x": 1.0}, "controller.kp.x: expected the dotted name of a field"),
    ({"controller..kp": 1.0}, "controller..kp: expected the dotted name of a field"),
    ({1: 1.0}, "changes: {1: 1.0}, expected values by dotted names"),
    ([("period", 1.0)], "changes: [('period', 1.0)], expected values by dotted names"),
]


@pytest.mark.parametrize(("changes", "line"), NO_NAMES)
def test_dotted_name_of_no_field_is_refused(changes, line):
    scenario = load_scenario("axis_pi")
    for change in (scenario.changed, lambda changes: load_scenario("axis_pi", changes)):
        with pytest.raises(InputError, match=re.escape(line)):
            change(changes)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: Drive(period=-1), "drive: period: -1, expected a number >= 0.000125 [s]"),
        (lambda: replace(Drive(), n1=[1.0]), "drive: n0: missing, expected n1 and n0 or neither"),
        (lambda: PlantChoice("cupled"), "plant choice: kind: 'cupled', expected one of axis, coup"),
        (Scenario, "scenario: controller.omega_r: missing, the gains need it, or kp and ki"),
    ],
)
def test_objects_are_checked_when_made_in_python(make, line):
    with pytest.raises(InputError, match=f"^{re.escape(line)}"):
        make()


AXIS = [
    ({"disturbance.amplitude": -np.inf}, "disturbance.amplitude: -inf, expected a finite number >"),
    ({"period": 10**400}, "period: a whole number of more than 64 bits, expected a number > 0 [s]"),
    ({"period": 2e16}, "period: 2e+16, expected a number > 0 [s] of at most 1e+16"),
    ({"controller.kp": []}, "controller.kp: empty, expected a list of numbers > 0 [N m s/rad], "),
    ({"plant": Drive()}, "plant: Drive("),
    ({"plant": None}, "plant: empty, expected a PlantChoice"),
    ({"controller.zeta": [0.0], "controller.kp": None}, "controller.zeta[1]: 0.0, exp"),  # first
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
def test_bad_scenario_field_is_named(fields, line):
    with pytest.raises(InputError, match=f"^scenario 'axis_pi': {re.escape(line)}.*$") as error:
        changed("axis_pi", fields)
    assert len(error.value.problems) == 1


MANY = [
    (load_scenario, "plant: {kind: coupled}\n" + "".join(f"k{k}: 1\n" for k in range(3000)), 2980),
    (load_catalogue, f"motors: [{'{}, ' * 3000}]", None),
    (load_sizing, SIZING.format(motions=", ".join(f"m{k}" for k in range(3000))), 980),
    (load_sizing, SIZING.format(motions=", ".join(f"leans{k}" for k in range(30))), 10),
]


@pytest.mark.parametrize("load, text, more", MANY)
def test_similar_names_are_searched_for_told_mistakes_alone(
    load, text, more, tmp_path, monkeypatch
):
    """A search for similar names takes up to milliseconds, and a small file has 90 000 mistakes."""
    find, searched = difflib.get_close_matches, []
    monkeypatch.setattr(
        difflib, "get_close_matches", lambda *a, **b: searched.append(a) or find(*a, **b)
    )
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load(tmp_path / "a.yaml")
    *told, last = error.value.lines
    assert len(told) == MAX_PROBLEMS >= len(searched)
    assert re.fullmatch(rf"{tmp_path}/a.yaml: {more or '[0-9]+'} more", last)
    assert all("another problem" not in line for line in told)


def test_file_with_too_many_mappings_is_refused():
    hold = {"_tag": "!Hold", "duration": 1}
    assert len(Track(joint="a", segments=[hold] * 19_999).segments) == 19_999
    with pytest.raises(InputError, match=r"segments\[20000\]: more than 20000 mappings"):
        Track(joint="a", segments=[hold] * 20_000)


OPEN = ("p_pi", "pi_scheduled")  # kinds that leave the feedforward to the scenario
FIXED = tuple(kind for kind in CONTROLLERS if kind not in OPEN)
OPTIONS = [
    (CONTROLLERS, "controller.omega_r", None, "missing, the gains need it, or kp and"),
    (CONTROLLERS, "controller.friction_compensation", True, "needs pla"),
    (FIXED, "controller.feedforward", "none", "{} takes none, only p_pi, pi_sch"),
    (OPEN, "controller.feedforward", "full", "'full', expected one of none, ctc, "),
    ([*FIXED, "pi_scheduled"], "controller.position_gain", [1.0] * 4, "{} takes none, only p_pi"),
    (OPEN, "controller.feedforward_gain", [1.0] * 4, "{} has no feedforward"),
    (["pi", "inverse_dynamics"], "controller.feedforward_gain", [1.0] * 4,
     "{} takes none, only pi_ctc, pi_id, p_pi, pi_scheduled"),
    (["pi_id", "p_pi", "inverse_dynamics"], "controller.setpoint_weight", 0.5,
     "{} takes none, only pi, pi_ctc, pi_dob, pi_scheduled"),
    (["inverse_dynamics"], "controller.anti_windup", True,
     "inverse_dynamics takes none, only pi, pi_ctc, pi_id, pi_dob, p_pi, pi_scheduled"),
    (CONTROLLERS, "plant.i_eff", [1.0] * 4, "the coupled plant has its inertia from the"),
]  # fmt: skip


@pytest.mark.parametrize(("kinds", "field", "value", "line"), OPTIONS)
def test_unused_field_of_controller_or_plant_is_refused(kinds, field, value, line):
    for kind in kinds:
        fields = {"controller.kind": kind}
        changed("coupled_pi", fields)
        with pytest.raises(InputError, match=f": {field}: {re.escape(line.format(kind))}.*$"):
            changed("coupled_pi", fields | {field: value})


def test_model_without_a_file_has_a_schema():
    """As those of controllers in files that are run; its fields have no descriptions then."""
    made_here: dict[str, Any] = {"Input": Input, "dataclass": dataclass}
    exec("@dataclass(frozen=True)\nclass Own(Input):\n    x: float = 1.0\n", made_here)
    assert schema_of(made_here["Own"])["properties"] == {"x": {"default": 1.0, "type": "number"}}
