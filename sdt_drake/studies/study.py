"""A study: a base scenario, what varies in it, and how; from YAML."""

import copy
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from sdt_drake.analysis.comparison import check_labels, with_controller
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import (
    FileOf,
    Input,
    NotNegative,
    Number,
    OneOf,
    Positive,
    Problems,
    Tagged,
    check,
    setting,
)
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.run.scenario import ControllerChoice, Scenario, load_scenario
from sdt_drake.studies.distributions import MOST_RUNS, Choice, Grid, List, Random, text_problems
from sdt_drake.studies.fields import Field, Value, check_changes, find_field
from sdt_drake.studies.table import is_column

SAMPLINGS = ("random", "latin_hypercube")
APPLY = ("value", "factor", "offset")
_MOST = 2**64 - 1


@dataclass
class Variable(Input):
    """What varies in a study: one field of the scenario or several, and how."""

    name: str = ""
    """Of the column in the results; the first field by default."""
    fields: list[str] = setting([])
    """Dotted names in the scenario ("plant.friction.coulomb", or "controller.kp[2]" for one
    entry of a list); they all get the same draw. "controller" takes labels: "p_pi+id"."""
    apply: Annotated[str, OneOf(APPLY)] = "value"
    """The draw is the "value" of the field, a "factor" on what the base scenario has there, or
    an "offset" to it. A list gets it in every entry."""
    distribution: Annotated[Random | Grid | List | Choice, Tagged()] = setting(None)
    """Of the draws; must be given."""

    def __post_init__(self) -> None:
        self.name = self.name or next(iter(self.fields), "")

    def problems(self) -> Problems:
        if not self.fields:
            yield "fields", "none, expected the dotted name of a field"
        if self.distribution is None:
            yield "distribution", "missing, expected !Uniform, !Normal, !Grid or the like"
            return
        if is_column(self.name):
            yield "name", f"{self.name} is a column of the results"
        yield from text_problems("name", self.name)
        for target in self.targets:
            is_text = target.type in (str, bool, ControllerChoice)
            if is_text != self.takes_texts:
                yield "", f"{target.name} takes {'texts (!Choice)' if is_text else 'numbers'}"
            elif is_text and self.apply != "value":
                yield "apply", f"{self.apply}, but {target.name} is no number"

    @property
    def takes_texts(self) -> bool:
        """Whether its values are texts rather than numbers."""
        return isinstance(self.distribution, Choice)

    @cached_property
    def targets(self) -> list[Field]:
        """The fields of the scenario that the variable sets.

        Raises:
            InputError: for a name that no scenario has.
        """
        return [find_field(name) for name in self.fields]

    @property
    def examples(self) -> list[Value]:
        """Some values of the variable; all if they are listed."""
        if isinstance(self.distribution, Random):
            return self.distribution.quantile(np.array([0.5])).tolist()
        if isinstance(self.distribution, Grid):
            return [self.distribution.start]
        return self.distribution.levels()

    def put(self, scenario: Scenario, value: Value) -> Scenario:
        """Put a draw into a scenario, which is changed in place.

        Raises:
            InputError: for a value that the field does not take.
        """
        for target in self.targets:
            if target.type is ControllerChoice:
                scenario = with_controller(scenario, str(value))
            else:
                target.put(scenario, _converted(value, target), self.apply)
        return scenario


def _converted(value: Value, target: Field) -> Value | bool:
    if target.type is not bool:
        return value
    if value not in ("true", "false"):
        raise InputError(f"{target.name}: '{value}', expected true or false")
    return value == "true"


@dataclass
class Study(Input):
    """Many variants of a scenario."""

    folder = Path()  # without a type: so it is no field
    """Folder that files named by variables start from; where the study was loaded from."""

    name: str = ""
    """Short name; that of the file by default."""
    scenario: Annotated[str, FileOf("scenario")] = ""
    """File of the base, relative to the study's own folder, or the name of one that ships with
    the package; must be given."""
    draws: int = setting(1, ge=1, le=_MOST, unit="-")
    """How many times the random variables are drawn; each draw is run with every combination of
    the levels of the others, so that these can be compared in pairs."""
    seed: int = setting(0, ge=0, le=_MOST, unit="-")
    """Of the draws. A variable has the same draws whatever the others are."""
    sampling: Annotated[str, OneOf(SAMPLINGS)] = "random"
    """"random", or "latin_hypercube": of each variable one draw in each of as many equally
    likely intervals as there are draws."""
    accuracy: Number = setting(0.001, ge=1e-12, le=0.01, unit="rad/s")
    """Of the integrator, instead of that of the scenario: speeds are good to it."""
    timeout: Positive = setting(300.0, unit="s")
    """What a run may take before it is given up."""
    pause: NotNegative = setting(0.0, unit="s")
    """Rest between two runs of a motion, for the temperature of the windings; of use where the
    base scenario has motors of a catalogue."""
    variables: list[Variable] = setting([])
    """What varies; at least one."""

    def problems(self) -> Problems:
        yield from text_problems("name", self.name)
        if "/" in self.name or self.name in (".", ".."):
            yield "name", f"{self.name}, expected one that a folder can have"
        names = [variable.name for variable in self.variables]
        if not names:
            yield "variables", "none, expected at least one"
        for name in {name for name in names if names.count(name) > 1}:
            yield "variables", f"two are named {name}"
        yield from self._field_problems()
        if self.draws > 1 and not any(isinstance(v.distribution, Random) for v in self.variables):
            yield "draws", f"{self.draws}, but no variable is random; remove"
        if self._count > MOST_RUNS:
            yield "variables", f"too many runs, expected at most {MOST_RUNS:,}"

    def _field_problems(self) -> Problems:
        """Of two draws for a field the last would win, and the first still be in the results."""
        owners: dict[tuple[str, ...], dict[int | None, str]] = {}
        for variable in self.variables:
            for target in (touched for name in variable.targets for touched in name.touched):
                others = owners.setdefault(target.parts, {})
                if others and (target.entry is None or {None, target.entry} & others.keys()):
                    names = " and ".join(dict.fromkeys([*others.values(), variable.name]))
                    yield "variables", f"{target.name} gets two values, of {names}"
                others[target.entry] = variable.name

    def validate(self, base: Scenario) -> None:
        """Check everything that a study says, also that the base scenario has what varies.

        Raises:
            InputError: naming the field and what would be right.
        """
        check(self)
        for i, variable in enumerate(self.variables):
            with within(f"variables[{i + 1}]"):
                if any(target.type is ControllerChoice for target in variable.targets):
                    check_labels([*map(str, variable.examples)], "distribution.values")
                for value in variable.examples:
                    variable.put(copy.deepcopy(base), value)

    @property
    def replaced(self) -> list[str]:
        """Fields whose values in the base scenario do not matter."""
        targets = [t for v in self.variables if v.apply == "value" for t in v.targets]
        return [field.name for target in targets for field in target.touched]

    def __len__(self) -> int:
        return self._count

    @property
    def _count(self) -> int:
        """Of the runs; Python refuses a `len` of more than 63 bits."""
        return self.draws * self.per_draw

    @property
    def per_draw(self) -> int:
        """Runs of each draw: every combination of the levels."""
        return math.prod(one.size for one in self._not_random)

    @property
    def _not_random(self) -> list[Grid | List | Choice]:
        every = (variable.distribution for variable in self.variables)
        return [one for one in every if not isinstance(one, Random)]

    @cached_property
    def _levels(self) -> list[list[Value]]:
        return [one.levels() for one in self._not_random]

    @cached_property
    def _drawn(self) -> dict[str, Array]:
        """Draws of the random variables by name, each of shape (draws,)."""
        return {
            v.name: v.distribution.quantile(self._shares(v.name))
            for v in self.variables
            if isinstance(v.distribution, Random)
        }

    def _shares(self, name: str) -> Array:
        generator = np.random.default_rng([self.seed, zlib.crc32(name.encode())])
        if self.sampling == "random":
            return generator.random(self.draws)
        from scipy.stats import qmc  # it takes a second

        return qmc.LatinHypercube(1, rng=generator).random(self.draws)[:, 0]

    def inputs(self, row: int) -> dict[str, Value]:
        """Value of each variable in a run, numbered from 0: level by level, then draw by draw."""
        draw, combination = divmod(row, self.per_draw)
        indices = np.unravel_index(combination, [len(values) for values in self._levels])
        chosen = (values[i] for values, i in zip(self._levels, indices, strict=True))
        return {
            v.name: float(self._drawn[v.name][draw]) if v.name in self._drawn else next(chosen)
            for v in self.variables
        }

    def scenario_of(self, base: Scenario, inputs: Mapping[str, Value]) -> Scenario:
        """The base scenario with the inputs of a run in it.

        Raises:
            InputError: for values that their fields do not take.
        """
        scenario = copy.deepcopy(base)
        scenario.accuracy = self.accuracy
        for variable in self.variables:
            scenario = variable.put(scenario, inputs[variable.name])
        return scenario


def load_study(
    path: str | Path, changes: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[Study, Scenario]:
    """A study from YAML, and its base scenario, with arguments as of `load_scenario`.

    Raises:
        InputError: with a line for each problem: file, field, and what would be right.
    """
    study, file = read_study(path)
    check_changes(changes or {}, ["accuracy", *study.replaced], file)
    base = load_scenario(study.scenario, changes, trust=trust)
    with within(file):
        study.validate(base)
    return study, base


def read_study(path: str | Path) -> tuple[Study, Path]:
    """A study from YAML, without its base scenario, and its file.

    Raises:
        InputError: as `load_study`.
    """
    study, file = load_yaml(Study, path, "study")
    if not study.scenario:
        raise InputError(f"{file}: scenario: missing, expected the file of the base scenario")
    study.folder = file.resolve().parent
    study.name = study.name or file.stem
    return study, file
