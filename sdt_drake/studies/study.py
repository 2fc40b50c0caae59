"""A study: a base scenario, what varies in it, and how; from YAML."""

# Drake's YAML loader reads the annotations here: they may not be postponed, and a union must be
# spelled Optional[...] or Union[...].
import copy
import math
import zlib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from statistics import NormalDist
from typing import Optional, Union

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.comparison import check_labels, with_controller
from sdt_drake.errors import InputError, checked_choice, checked_number
from sdt_drake.fields import setting
from sdt_drake.scenario import ControllerChoice, Scenario, load_scenario
from sdt_drake.studies.fields import Field, Value, find_field
from sdt_drake.studies.table import is_column
from sdt_drake.yaml_files import load_yaml

Array = NDArray[np.float64]

SAMPLINGS = ("random", "latin_hypercube")
APPLY = ("value", "factor", "offset")
MOST_RUNS = 10_000_000
_MOST = 2**64 - 1


# --- distributions ---------------------------------------------------------------------------
# Random ones have `quantile`, which takes shares in (0, 1) to values; the others have `levels`,
# which are all run, each with the same draws of the random ones, and `size`, how many they are:
# a study that is too large is refused before they are made.


@dataclass
class Uniform:
    """Evenly between low and high."""

    low: float = 0.0
    high: float = 0.0

    def validate(self, where: str) -> None:
        _check_width(self.low, self.high, where)

    def quantile(self, share: Array) -> Array:
        return self.low + (self.high - self.low) * share


@dataclass
class LogUniform:
    """Evenly in the logarithm, between low and high, both > 0."""

    low: float = 0.0
    high: float = 0.0

    def validate(self, where: str) -> None:
        checked_number(self.low, f"{where}.low", minimum=0, exclusive=True)
        _check_width(self.low, self.high, where)

    def quantile(self, share: Array) -> Array:
        return self.low ** (1 - share) * self.high**share


@dataclass
class Normal:
    """Gaussian; with low or high, what is beyond is cut off and the rest scaled up."""

    mean: float = 0.0
    std: float = 0.0
    low: Optional[float] = None
    high: Optional[float] = None

    def validate(self, where: str) -> None:
        checked_number(self.mean, f"{where}.mean")
        checked_number(self.std, f"{where}.std", minimum=0, exclusive=True)
        low, high = self._range
        if not low < high:
            raise InputError(f"{where}: low {low:g}, high {high:g}, expected low < high")
        first, last = self._shares
        if not last - first > 1e-6:
            raise InputError(f"{where}: nothing of it is between low and high")

    @property
    def _range(self) -> tuple[float, float]:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high

    @property
    def _shares(self) -> tuple[float, float]:
        normal, (low, high) = NormalDist(self.mean, self.std), self._range
        return normal.cdf(low), normal.cdf(high)

    def quantile(self, share: Array) -> Array:
        normal, (first, last) = NormalDist(self.mean, self.std), self._shares
        shares = first + (last - first) * share
        inside = np.clip(shares, 1e-300, 1 - 1e-16)
        values = np.fromiter(map(normal.inv_cdf, inside), float, len(inside))
        return np.clip(values, *self._range)


@dataclass
class Grid:
    """count values from start to stop, equal steps apart, both ends included."""

    start: float = 0.0
    stop: float = 0.0
    count: int = 2

    def validate(self, where: str) -> None:
        checked_number(self.start, f"{where}.start")
        checked_number(self.stop, f"{where}.stop")
        _check_whole(self.count, 2, MOST_RUNS, f"{where}.count")
        if self.start == self.stop:
            raise InputError(f"{where}: start and stop are both {self.start:g}")

    @property
    def size(self) -> int:
        return self.count

    @property
    def examples(self) -> list[Value]:
        return [self.start]

    def levels(self) -> list[Value]:
        return np.linspace(self.start, self.stop, self.count).tolist()


class _Values:
    @property
    def size(self) -> int:
        return len(self.values)

    @property
    def examples(self) -> list[Value]:
        return self.values

    def levels(self) -> list[Value]:
        return list(self.values)


@dataclass
class List(_Values):
    """These numbers."""

    values: list[float] = field(default_factory=list)

    def validate(self, where: str) -> None:
        for value in self.values:
            checked_number(value, f"{where}.values")
        _check_levels(self.values, f"{where}.values")


@dataclass
class Choice(_Values):
    """These texts: kinds, labels of controllers, names of motions or motors, true or false."""

    values: list[str] = field(default_factory=list)

    def validate(self, where: str) -> None:
        for value in self.values:
            _check_text(value, f"{where}.values")
        _check_levels(self.values, f"{where}.values")


def _check_width(low: float, high: float, where: str) -> None:
    checked_number(low, f"{where}.low")
    checked_number(high, f"{where}.high")
    if not low < high:
        raise InputError(f"{where}: low {low:g}, high {high:g}, expected low < high")


def _check_levels(values: list, where: str) -> None:
    if not values:
        raise InputError(f"{where}: empty, expected at least one value")
    if len(set(values)) < len(values):
        raise InputError(f"{where}: {values} has a value twice")


def _check_whole(value: int, least: int, most: int, where: str) -> None:
    if not least <= value <= most:
        raise InputError(
            f"{where}: {_shown(value)}, expected a whole number from {least} to {most}"
        )


def _shown(value: int, form: str = "") -> str:
    return format(value, form) if abs(value) <= _MOST else "a number of more than 64 bits"


def _check_text(text: str, where: str) -> None:
    """Names and levels go into file names, tables and pages."""
    if not text.isprintable() or text != text.strip():
        raise InputError(
            f"{where}: {text!r}, expected characters that are seen, no space at an end"
        )


# --- the study -------------------------------------------------------------------------------


@dataclass
class Variable:
    """What varies.

    Attributes:
        name: of the column in the results; the first field by default.
        fields: dotted names in the scenario ("plant.friction.coulomb", or "controller.kp[2]" for
            one entry of a list); they all get the same draw. "controller" takes labels: "p_pi+id".
        apply: the draw is the "value" of the field, a "factor" on what the base scenario has
            there, or an "offset" to it. A list gets it in every entry.
        distribution: of the draws.
    """

    name: str = ""
    fields: list[str] = field(default_factory=list)
    apply: str = "value"
    distribution: Union[Uniform, LogUniform, Normal, Grid, List, Choice] = field(
        default_factory=Uniform
    )

    @property
    def random(self) -> bool:
        """Whether it is drawn; else all its levels are run."""
        return hasattr(self.distribution, "quantile")

    @property
    def takes_texts(self) -> bool:
        """Whether its values are texts rather than numbers."""
        return isinstance(self.distribution, Choice)

    @cached_property
    def targets(self) -> list[Field]:
        """The fields.

        Raises:
            InputError: for a name that no scenario has.
        """
        return [find_field(name) for name in self.fields]

    def validate(self, where: str, base: Scenario) -> None:
        """Check fields and distribution against the base scenario.

        Raises:
            InputError: naming `where` and what would be right.
        """
        if not self.fields:
            raise InputError(f"{where}.fields: none, expected the dotted name of a field")
        checked_choice(self.apply, APPLY, f"{where}.apply")
        self.distribution.validate(f"{where}.distribution")
        is_text = self.takes_texts
        for target in self._located(where):
            if is_text != (target.type in (str, bool, ControllerChoice)):
                kind = "texts (!Choice)" if not is_text else "numbers"
                raise InputError(f"{where}: {target.name} takes {kind}")
            if is_text and self.apply != "value":
                raise InputError(f"{where}.apply: {self.apply}, but {target.name} is no number")
            if target.type is ControllerChoice:
                check_labels(self.distribution.levels(), f"{where}.distribution.values")
            try:
                target.get(base)
                if self.apply != "value":
                    target.change(copy.deepcopy(base), self.apply, 1.0)
                else:
                    for value in self.examples:
                        self.put(copy.deepcopy(base), value)
            except InputError as error:
                raise InputError(f"{where}: {error}") from None

    def _located(self, where: str) -> list[Field]:
        try:
            return self.targets
        except InputError as error:
            raise InputError(f"{where}.fields: {error}") from None

    @property
    def examples(self) -> list[Value]:
        """Some of its values; all if they are listed."""
        if self.random:
            return self.distribution.quantile(np.array([0.5])).tolist()
        return self.distribution.examples

    def put(self, scenario: Scenario, value: Value) -> Scenario:
        """The scenario, changed in place, with a draw in it.

        Raises:
            InputError: for a value that the field does not take.
        """
        for target in self.targets:
            if target.type is ControllerChoice:
                scenario = with_controller(scenario, str(value))
            elif self.apply == "value":
                target.set(scenario, _converted(value, target))
            else:
                target.change(scenario, self.apply, float(value))
        return scenario


def _converted(value: Value, target: Field) -> Value | bool | int:
    if target.type is bool:
        if value not in ("true", "false"):
            raise InputError(f"{target.name}: '{value}', expected true or false")
        return value == "true"
    if target.type is int:
        return round(float(value))
    return value


@dataclass
class Study:
    """Many variants of a scenario.

    Attributes:
        name: short name.
        scenario: file of the base, relative to the study's own folder, or package://sdt/...
        draws: how many times the random variables are drawn; each draw is run with every
            combination of the levels of the others, so that these can be compared in pairs.
        seed: of the draws. A variable has the same draws whatever the others are.
        sampling: "random", or "latin_hypercube": of each variable one draw in each of as many
            equally likely intervals as there are draws.
        accuracy: of the integrator, instead of that of the scenario: speeds are good to half of it
            [rad/s].
        timeout: what a run may take before it is given up [s].
        pause: rest between two runs of a motion, for the temperature of the windings [s]; of use
            where the base scenario has motors of a catalogue.
        variables: what varies.
        folder: that files named by variables start from; where the study was loaded from. Not in
            the YAML.
    """

    folder = Path()  # without a type: so it is no field

    name: str = ""
    scenario: str = ""
    draws: int = 1
    seed: int = 0
    sampling: str = "random"
    accuracy: float = setting(1e-3, minimum=1e-12, maximum=0.01, unit="rad/s")
    timeout: float = 300.0
    pause: float = 0.0
    variables: list[Variable] = field(default_factory=list)

    def validate(self, base: Scenario) -> None:
        """Check everything against the base scenario.

        Raises:
            InputError: naming the field and what would be right.
        """
        _check_text(self.name, "name")
        if "/" in self.name or self.name in (".", ".."):
            raise InputError(f"name: {self.name}, expected one that a folder can have")
        _check_whole(self.draws, 1, _MOST, "draws")
        _check_whole(self.seed, 0, _MOST, "seed")
        checked_choice(self.sampling, SAMPLINGS, "sampling")
        checked_number(self.timeout, "timeout", minimum=0, exclusive=True)
        checked_number(self.pause, "pause", minimum=0)
        if not self.variables:
            raise InputError("variables: none, expected at least one")
        for i, variable in enumerate(self.variables):
            variable.validate(f"variables[{i + 1}]", base)
        names = [variable.name for variable in self.variables]
        for i, name in enumerate(names):
            _check_text(name, f"variables[{i + 1}].name")
            if is_column(name):
                raise InputError(f"variables[{i + 1}].name: {name} is a column of the results")
            if names.count(name) > 1:
                raise InputError(f"variables: two are named {name}")
        self._check_fields()
        if self.draws > 1 and not any(variable.random for variable in self.variables):
            raise InputError(f"draws: {self.draws}, but no variable is random; remove")
        if self._count > MOST_RUNS:
            count = _shown(self._count, ",")
            raise InputError(f"{count} runs, expected at most {MOST_RUNS:,}")

    def _check_fields(self) -> None:
        """Of two draws for a field the last would win, and the first still be in the results."""
        owners: dict[tuple, dict[int | None, str]] = {}
        for variable in self.variables:
            for target in (touched for name in variable.targets for touched in name.touched):
                others = owners.setdefault(target.parts, {})
                if others and (target.entry is None or {None, target.entry} & others.keys()):
                    names = " and ".join(dict.fromkeys([*others.values(), variable.name]))
                    raise InputError(f"variables: {target.name} gets two values, of {names}")
                others[target.entry] = variable.name

    def __len__(self) -> int:
        return self._count

    @property
    def _count(self) -> int:
        """Of the runs; Python refuses a `len` of more than 63 bits."""
        return self.draws * math.prod(v.distribution.size for v in self.variables if not v.random)

    @cached_property
    def _levels(self) -> list[list[Value]]:
        return [v.distribution.levels() for v in self.variables if not v.random]

    @cached_property
    def _drawn(self) -> dict[str, Array]:
        """Draws of the random variables by name, each of shape (draws,)."""
        return {v.name: self._draw(v) for v in self.variables if v.random}

    def _draw(self, variable: Variable) -> Array:
        generator = np.random.default_rng([self.seed, zlib.crc32(variable.name.encode())])
        share = generator.random(self.draws)
        if self.sampling == "latin_hypercube":
            share = (generator.permutation(self.draws) + share) / self.draws
        return variable.distribution.quantile(share)

    def inputs(self, row: int) -> dict[str, Value]:
        """Value of each variable in a run, numbered from 0: level by level, then draw by draw."""
        draw, combination = divmod(row, len(self) // self.draws)
        levels = list(self._levels)
        chosen: list[Value] = []
        for values in reversed(levels):
            combination, i = divmod(combination, len(values))
            chosen.append(values[i])
        return {
            v.name: float(self._drawn[v.name][draw]) if v.random else chosen.pop()
            for v in self.variables
        }

    def scenario_of(self, base: Scenario, inputs: dict[str, Value]) -> Scenario:
        """The base scenario with the inputs of a run in it.

        Raises:
            InputError: for values that their fields do not take.
        """
        scenario = copy.deepcopy(base)
        scenario.accuracy = self.accuracy
        for variable in self.variables:
            scenario = variable.put(scenario, inputs[variable.name])
        return scenario


def load_study(path: str | Path) -> tuple[Study, Scenario]:
    """A study from YAML, and its base scenario.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    study, file = load_yaml(Study, path)
    if not study.scenario:
        raise InputError(f"{file}: scenario: missing, expected the file of the base scenario")
    study.folder = file.resolve().parent
    if not study.scenario.startswith("package://"):
        study.scenario = str(study.folder / study.scenario)
    study.name = study.name or file.stem
    base = load_scenario(study.scenario)
    for variable in study.variables:
        variable.name = variable.name or next(iter(variable.fields), "")
    try:
        study.validate(base)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    return study, base
