"""A study: a base scenario and the variables that change it, loaded from YAML."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from sdt_drake.analysis.comparison import check_labels, controller_changes
from sdt_drake.analysis.stopping import Stopping
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.fields import (
    FileOf,
    Input,
    NotNegative,
    Number,
    Positive,
    Problems,
    Values,
    field,
)
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.run.options import ControllerOptions
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.studies import distributions
from sdt_drake.studies.fields import Field, check_changes, find_field
from sdt_drake.studies.table import Value, is_column

_MAX_INTEGER = 2**64 - 1
QUICK_ACCURACY = 0.01
"""Accuracy of simulated speeds in a quick study [rad/s]."""


@dataclass(frozen=True)
class Variable(Input):
    """A variable of a study: one or several fields of the scenario, and their distribution."""

    name: str = ""
    """Name of the column in the results; the first field by default."""
    fields: Values[str] = field(())
    """Dotted names of scenario fields ("plant.friction.coulomb", or "controller.kp[2]" for one
    entry of a list); all get the same draw. "controller" accepts labels: "p_pi+id"."""
    apply: Literal["value", "factor", "offset"] = "value"
    """Use of the draw: the "value" of the field, a "factor" on its value in the base scenario,
    or an "offset" to it. In a list, every entry is changed."""
    distribution: distributions.AnyDistribution = field(None)
    """Distribution of the draws; must be given."""

    def complete(self) -> None:
        object.__setattr__(self, "name", self.name or next(iter(self.fields), ""))

    def problems(self) -> Problems:
        if not self.fields:
            yield "fields", "none, expected the dotted name of a field"
        if self.distribution is None:
            yield "distribution", "missing, expected !Uniform, !Normal, !Grid or the like"
            return
        if is_column(self.name):
            yield "name", f"{self.name} is a column of the results, expected another name"
        yield from distributions.text_problems("name", self.name)
        for target in self.targets:
            is_text = target.type in (str, bool, ControllerOptions)
            if is_text != self.takes_texts:
                kinds = ("numbers", "texts (!Choice)")
                found, expected = kinds if is_text else reversed(kinds)
                yield "", f"{target.name} gets {found}, expected {expected}"
            elif is_text and self.apply != "value":
                yield "apply", f"{self.apply}, expected value, as {target.name} is not a number"

    @property
    def takes_texts(self) -> bool:
        """True if the variable's values are texts rather than numbers."""
        return isinstance(self.distribution, distributions.Choice)

    @cached_property
    def targets(self) -> list[Field]:
        """The scenario fields that the variable changes.

        Raises:
            InputError: for an unknown name.
        """
        return [find_field(name) for name in self.fields]

    @property
    def unit(self) -> str:
        """Unit of a draw: that of the fields, "factor", or "" for texts and shares."""
        if self.apply == "factor":
            return "factor"
        units = {target.unit for target in self.targets} - {"-"}
        return units.pop() if len(units) == 1 else ""

    @property
    def examples(self) -> list[Value]:
        """Values to check before a run: all listed ones, or else one."""
        if isinstance(self.distribution, distributions.Random):
            return self.distribution.quantile(np.array([0.5])).tolist()
        if isinstance(self.distribution, distributions.Grid):
            return [self.distribution.start]
        return self.distribution.levels()

    def changes(self, base: Scenario, value: Value) -> dict[str, Any]:
        """Return the values of the base scenario's fields that a draw changes, by dotted name.

        Raises:
            InputError: for a value that the field does not accept.
        """
        changes: dict[str, Any] = {}
        for target in self.targets:
            if target.type is ControllerOptions:
                changes |= controller_changes(str(value))
            else:
                changes[target.name] = target.changed(base, _converted(value, target), self.apply)
        return changes


def _converted(value: Value, target: Field) -> Value | bool:
    if target.type is not bool:
        return value
    if value not in ("true", "false"):
        raise InputError(f"{target.name}: '{value}', expected true or false")
    return value == "true"


@dataclass(frozen=True)
class Study(Input):
    """A study: many variants of one base scenario.

    >>> from sdt_drake.studies.distributions import Choice, Grid
    >>> frequency = Variable("omega", ["disturbance.omega_d"], "value", Grid(1, 3, 3))
    >>> controller = Variable("", ["controller"], "value", Choice(["pi", "p_pi+id"]))
    >>> study = Study(variables=[frequency, controller])
    >>> len(study), study.inputs(5)
    (6, {'omega': 3.0, 'controller': 'p_pi+id'})
    """

    folder = Path()  # unannotated, so that it is not a field of the dataclass
    """Folder of the study's file. Relative paths in variables start here."""

    name: str = ""
    """Short name; the name of the file by default."""
    scenario: Annotated[str, FileOf("scenario")] = ""
    """Base scenario: a file relative to the study's folder, or the name of a shipped one; must
    be given."""
    draws: int = field(1, ge=1, le=_MAX_INTEGER, unit="-")
    """Number of draws of the random variables. Each draw is run with every combination of the
    other variables' levels, which can so be compared in pairs."""
    seed: int = field(0, ge=0, le=_MAX_INTEGER, unit="-")
    """Seed of the draws. The draws of a variable do not depend on the other variables."""
    sampling: Literal["random", "latin_hypercube"] = "random"
    """Sampling of the draws: "random", or "latin_hypercube" with one draw in each of `draws`
    equally likely intervals of every variable."""
    accuracy: Number = field(0.001, ge=1e-12, le=0.01, unit="rad/s")
    """Accuracy of simulated speeds, in place of the scenario's."""
    timeout: Positive = field(300.0, unit="s")
    """Longest computing time of a run; a longer run is stopped and counts as timed out."""
    pause: NotNegative = field(0.0, unit="s")
    """Rest between two runs of a motion, in which the windings cool. It has an effect only with
    motors of a catalogue."""
    stops: Stopping | None = field(None)
    """Emergency stop that is simulated from every instant of each run; none by default."""
    variables: Values[Variable] = field(())
    """Variables of the study; at least one."""

    def problems(self) -> Problems:
        yield from distributions.text_problems("name", self.name)
        if "/" in self.name or self.name in (".", ".."):
            yield "name", f"{self.name}, expected the name of a folder"
        names = [variable.name for variable in self.variables]
        if not names:
            yield "variables", "none, expected at least one"
        for name in {name for name in names if names.count(name) > 1}:
            yield "variables", f"{name} names two variables, expected a different name for each"
        yield from self._field_problems()
        if self.draws > 1 and not any(
            isinstance(v.distribution, distributions.Random) for v in self.variables
        ):
            yield "draws", f"{self.draws}, but no variable is random; remove draws"
        if self._count > distributions.MAX_RUNS:
            yield (
                "variables",
                f"{self._count:.3g} runs, expected at most {distributions.MAX_RUNS:,}",
            )

    def _field_problems(self) -> Problems:
        """Yield a problem for each field that two variables set."""
        owners: dict[str, dict[int | None, str]] = {}
        for variable in self.variables:
            for target in (touched for name in variable.targets for touched in name.touched):
                others = owners.setdefault(target.whole, {})
                if others and (target.entry is None or {None, target.entry} & others.keys()):
                    names = " and ".join(dict.fromkeys([*others.values(), variable.name]))
                    yield "variables", f"{target.name} is set by {names}, expected one of them"
                others[target.entry] = variable.name

    def validate(self, base: Scenario) -> None:
        """Check that the variables fit the base scenario.

        Raises:
            InputError: naming the field and what is accepted.
        """
        for i, variable in enumerate(self.variables):
            with within(f"variables[{i + 1}]"):
                if any(target.type is ControllerOptions for target in variable.targets):
                    check_labels([*map(str, variable.examples)], "distribution.values")
                for value in variable.examples:
                    variable.changes(base, value)

    @property
    def replaced(self) -> list[str]:
        """Names of the fields whose values in the base scenario have no effect."""
        targets = [t for v in self.variables if v.apply == "value" for t in v.targets]
        return [field.name for target in targets for field in target.touched]

    def __len__(self) -> int:
        return self._count

    @property
    def _count(self) -> int:
        """The number of runs. Unlike `len` it may need more than 63 bits."""
        return self.draws * self.per_draw

    @property
    def per_draw(self) -> int:
        """Number of runs of each draw: all combinations of the levels."""
        return math.prod(one.size for one in self._not_random)

    @property
    def _not_random(self) -> list[distributions.Grid | distributions.List | distributions.Choice]:
        every = (variable.distribution for variable in self.variables)
        return [one for one in every if not isinstance(one, distributions.Random)]

    @cached_property
    def _levels(self) -> list[list[Value]]:
        return [one.levels() for one in self._not_random]

    @cached_property
    def _drawn(self) -> dict[str, Array]:
        """Draws of the random variables by name, shape (draws,) each."""
        return {
            v.name: v.distribution.quantile(self._shares(v.name))
            for v in self.variables
            if isinstance(v.distribution, distributions.Random)
        }

    def _shares(self, name: str) -> Array:
        """Return the shares in [0, 1) of a variable's draws, shape (draws,)."""
        generator = np.random.default_rng([self.seed, zlib.crc32(name.encode())])
        if self.sampling == "random":
            return generator.random(self.draws)
        from scipy.stats import qmc  # it takes a second

        return qmc.LatinHypercube(1, rng=generator).random(self.draws)[:, 0]

    def inputs(self, row: int) -> dict[str, Value]:
        """Return the value of each variable in row number `row`, from 0.

        Rows are sorted by draw, then by the levels of the other variables.
        """
        draw, combination = divmod(row, self.per_draw)
        indices = np.unravel_index(combination, [len(values) for values in self._levels])
        chosen = (values[i] for values, i in zip(self._levels, indices, strict=True))
        return {
            v.name: float(self._drawn[v.name][draw]) if v.name in self._drawn else next(chosen)
            for v in self.variables
        }

    def changes(self, base: Scenario, inputs: Mapping[str, Value]) -> dict[str, Any]:
        """Return the values of the base scenario's fields that a row changes, by dotted name.

        Raises:
            InputError: for values that their fields do not accept.
        """
        changes: dict[str, Any] = {"accuracy": self.accuracy}
        for variable in self.variables:
            changes |= variable.changes(base, inputs[variable.name])
        return changes


def shortened(study: Study, draws: int | None = None, *, quick: bool = False) -> Study:
    """Return a study with another number of draws.

    `quick` leaves at most two draws and the coarsest accuracy, for a first look.

    Raises:
        InputError: if no variable is random, so that nothing is drawn.
    """
    changes: dict[str, Any] = {}
    if quick:
        changes = {"draws": min(study.draws, 2), "accuracy": QUICK_ACCURACY}
    if draws is not None:
        changes["draws"] = draws
    short = replace(study, **changes)
    object.__setattr__(short, "folder", study.folder)
    return short


def load_study(
    path: str | Path, changes: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[Study, Scenario]:
    """Load a study and its base scenario.

    Args:
        path: a file, or the name of a shipped study.
        changes: values of scenario fields by dotted name, as in `load_scenario`.
        trust: whether the Python file of a controller is run without a question.

    Raises:
        InputError: with a line for each problem: file, field, and what is accepted.
    """
    study, file = read_study(path)
    check_changes(changes or {}, ["accuracy", *study.replaced], file)
    base = load_scenario(study.scenario, changes, trust=trust)
    with within(file):
        study.validate(base)
    return study, base


def read_study(path: str | Path) -> tuple[Study, Path]:
    """Load a study without its base scenario; return it and its file.

    Raises:
        InputError: as `load_study`.
    """
    study, file = load_yaml(Study, path, "study")
    if not study.scenario:
        raise InputError(f"{file}: scenario: missing, expected the file of the base scenario")
    object.__setattr__(study, "folder", file.resolve().parent)
    return study, file
