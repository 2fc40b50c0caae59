"""Checks of the arguments of public functions: each returns the value, or raises InputError."""

import functools
import inspect
import math
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import MAX_NUMBER, InputError, at_most, one_line

MAX_PERIODS = 1_000_000
"""Largest number of sample periods of a motion: 83 min of 5 ms, planned within a minute."""

F = TypeVar("F", bound=Callable[..., Any])
Check = Callable[[Any, str], object]
"""A check of an argument's value and name."""


def takes(**checks: Check) -> Callable[[F], F]:
    """Check the named arguments of a function. Defaults are passed unchecked.

    >>> @takes(period=positive)
    ... def rate(period):
    ...     return 1 / period
    >>> rate(0.5)
    2.0
    """

    def decorated(function: F) -> F:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def checked(*args: Any, **kwargs: Any) -> Any:
            bound = signature.bind(*args, **kwargs)
            for name in [name for name in bound.arguments if name in checks]:
                value = bound.arguments[name]
                if value is not signature.parameters[name].default:
                    bound.arguments[name] = checks[name](value, name)
            return function(*bound.args, **bound.kwargs)

        return cast(F, checked)

    return decorated


def typed(function: F) -> F:
    """Check all arguments of a function against their annotations."""
    hints = get_type_hints(function)
    return takes(**{name: instance_of(hint) for name, hint in hints.items() if name != "return"})(
        function
    )


# --- types -----------------------------------------------------------------------------------


def instance_of(hint: Any, made_by: str = "") -> Check:
    """Return a check for a type: a class, a union, or a list or mapping with entries.

    `made_by` names the function that makes such an object.
    """

    def checked(value: Any, name: str) -> object:
        if not _fits(value, hint):
            is_empty = isinstance(value, Sequence | Mapping) and not len(value)
            given = f"{'an empty' if is_empty else 'a'} {type(value).__name__}"
            given = f"the class {value.__name__}" if isinstance(value, type) else given
            accepted = _in_words(hint) + (f", as {made_by} makes it" if made_by else "")
            raise InputError(f"{given}, expected {accepted}", place=name)
        return value

    return checked


def _fits(value: Any, hint: Any) -> bool:
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return any(_fits(value, option) for option in inner)
    if kind is float:
        return isinstance(value, Real)
    if not isinstance(value, kind):
        return False
    if kind is Sequence:
        is_list = len(value) > 0 and not isinstance(value, str | bytes)
        return is_list and all(_fits(entry, inner[0]) for entry in value)
    if kind is Mapping:
        return len(value) > 0 and all(_fits(entry, inner[1]) for entry in value.values())
    return True


def _in_words(hint: Any) -> str:
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return " or ".join(_in_words(option) for option in inner)
    if kind is Sequence:
        return f"a list, each entry {_in_words(inner[0])}"
    if kind is Mapping:
        return f"a mapping, each value {_in_words(inner[1])}"
    words = {
        "str": "a text", "float": "a number", "int": "a whole number", "bool": "True or False",
        "ndarray": "an array", "Callable": "a function", "NoneType": "None",
    }  # fmt: skip
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    return words.get(kind.__name__, f"{article} {kind.__name__}")


def a_path(value: Any, name: str) -> str | Path:
    """Return the path of a file or the name of a shipped one."""
    if not isinstance(value, str | os.PathLike):
        text = f"a {type(value).__name__}, expected a path, as a str or a Path"
        raise InputError(text, place=name)
    return value if isinstance(value, str) else Path(value)


def one_of(value: str, name: str, choices: Collection[str]) -> str:
    """Return `value` if it is one of `choices`."""
    if value not in choices:
        raise InputError(f"'{value}', expected one of {', '.join(choices)}", place=name)
    return value


# --- numbers ---------------------------------------------------------------------------------


def finite_number(value: Any, name: str, *, minimum: float = -math.inf) -> float:
    """Return `value` as a finite number >= `minimum`."""
    bound = f" >= {minimum:g}" if math.isfinite(minimum) else ""
    return _number(value, name, bound, lambda x: x >= minimum)


def positive(value: Any, name: str) -> float:
    """Return `value` as a finite number > 0."""
    return _number(value, name, " > 0", lambda x: x > 0)


def share(value: Any, name: str) -> float:
    """Return `value` as a number > 0 and <= 1."""
    if positive(value, name) > 1:
        raise InputError(f"{value}, expected at most 1", place=name)
    return float(value)


def _number(value: Any, name: str, bound: str, holds: Callable[[Any], bool]) -> float:
    if not (isinstance(value, Real) and abs(cast(float, value)) <= MAX_NUMBER and holds(value)):
        text = f"{one_line(value)}, expected a finite number{bound}{at_most(value)}"
        raise InputError(text, place=name)
    return float(value)


def whole_number(value: Any, name: str) -> int:
    """Return `value` as a whole number >= 1."""
    if not isinstance(value, Integral) or value < 1:
        raise InputError(f"{value!r}, expected a whole number >= 1", place=name)
    return int(value)


def whole_periods(duration: float, period: float, name: str) -> int:
    """Return the number of periods [s] in `duration` [s], a whole multiple of the period."""
    if not duration / MAX_PERIODS <= period:
        text = f"period {period:g} s, expected at least a {MAX_PERIODS}th of {duration:g} s"
        raise InputError(text, place=name)
    count = round(duration / period)
    if count < 1 or abs(count * period - duration) > 1e-9 * max(1.0, duration):
        text = f"{duration:g} s is not a whole multiple of the period {period:g} s"
        raise InputError(text, place=name)
    return count


def chosen_joints(joint: int | None, n: int, name: str = "joint") -> Sequence[int]:
    """Return the indices (from 0) of the joints to show: all n, or joint number 1 to n."""
    if joint is None:
        return range(n)
    if not isinstance(joint, Integral) or not 1 <= joint <= n:
        raise InputError(f"{joint!r}, expected 1 to {n}", place=name)
    return [joint - 1]


# --- arrays ----------------------------------------------------------------------------------


def positives(values: ArrayLike, name: str, n: int | None = None) -> Array:
    """Return `values` as finite numbers > 0, one for each joint, shape (n,); any n by default."""
    array = _array(values)
    is_list = array.ndim == 1 and len(array) > 0 and (n is None or len(array) == n)
    if not is_list or not ((array > 0) & (array < math.inf)).all():
        accepted = f"a list of {'' if n is None else f'{n} '}finite numbers > 0, one for each joint"
        raise InputError(f"{one_line(values)}, expected {accepted}", place=name)
    return array


def finite(shape: str) -> Check:
    """Return a check for arrays of finite numbers. `shape` gives the dimensions: "(N + 1, n)"."""

    def checked(value: Any, name: str) -> Array:
        array = _array(value)
        if array.ndim != shape.count(",") + (not shape.endswith(",)")) or not array.size:
            given = f"of shape {array.shape}" if array.ndim else one_line(value)
            raise InputError(f"{given}, expected numbers of shape {shape}", place=name)
        for place in zip(*(~(abs(array) < math.inf)).nonzero(), strict=True):
            where = ", ".join(map(str, place))
            raise InputError(f"{array[place]}, expected finite numbers", place=f"{name}[{where}]")
        return array

    return checked


def _array(values: ArrayLike) -> Array:
    """Return numbers as an array; NaN if they are no numbers."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)
