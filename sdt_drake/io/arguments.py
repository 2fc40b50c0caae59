"""Checks of the arguments of public functions."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_number, checked_type, one_line

F = TypeVar("F", bound=Callable[..., Any])
Kind = Callable[[Any, str], object]
"""A check of an argument's value and name that returns the value or raises InputError."""


def takes(**kinds: Kind) -> Callable[[F], F]:
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
            for name in [name for name in bound.arguments if name in kinds]:
                value = bound.arguments[name]
                if value is not signature.parameters[name].default:
                    bound.arguments[name] = kinds[name](value, name)
            return function(*bound.args, **bound.kwargs)

        return cast(F, checked)

    return decorated


def typed(function: F) -> F:
    """Check all arguments of a function against their annotations, as `like` does."""
    hints = get_type_hints(function)
    kinds = {name: like(hint) for name, hint in hints.items() if name != "return"}
    return takes(**kinds)(function)


def like(hint: Any) -> Kind:
    """Return a check for an annotation: a class, a union, or a list or mapping with entries."""

    def checked(value: Any, name: str) -> object:
        if not _fits(value, hint):
            is_empty = isinstance(value, Sequence | Mapping) and not len(value)
            given = f"{'an empty' if is_empty else 'a'} {type(value).__name__}"
            raise InputError(f"{given}, expected {_in_words(hint)}", place=name)
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
    words: dict[Any, str] = {str: "a text", float: "a number", int: "a whole number"}
    words |= {bool: "True or False", np.ndarray: "an array", Callable: "a function"}
    words[type(None)] = "None"
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    return words.get(kind, f"{article} {kind.__name__}")


def a(kind: type, made_by: str) -> Kind:
    """Return a check for objects of a type. `made_by` names the function that creates one."""

    def checked(value: Any, name: str) -> object:
        checked_type(value, kind, name, made_by)
        return value

    return checked


def a_path(value: Any, name: str) -> str | Path:
    """Check the path of a file or the name of a shipped one."""
    if not isinstance(value, str | os.PathLike):
        raise InputError(
            f"a {type(value).__name__}, expected a path, as a str or a Path", place=name
        )
    return value if isinstance(value, str) else Path(value)


def positive(value: Any, name: str) -> float:
    """Return `value` as a finite number > 0."""
    return checked_number(value, name, minimum=0, exclusive=True)


def share(value: Any, name: str) -> float:
    """Return `value` as a number > 0 and <= 1."""
    if positive(value, name) > 1:
        raise InputError(f"{value}, expected at most 1", place=name)
    return float(value)


def finite(shape: str) -> Kind:
    """Return a check for arrays of finite numbers. `shape` gives the dimensions: "(N + 1, n)"."""

    def checked(value: Any, name: str) -> Array:
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.array(np.nan)
        if array.ndim != shape.count(",") + (not shape.endswith(",)")) or not array.size:
            given = f"of shape {array.shape}" if array.ndim else one_line(value)
            raise InputError(f"{given}, expected numbers of shape {shape}", place=name)
        for place in np.argwhere(~np.isfinite(array)):
            where = ", ".join(map(str, place))
            raise InputError(
                f"{array[tuple(place)]}, expected finite numbers", place=f"{name}[{where}]"
            )
        return array

    return checked


def chosen_joints(joint: int | None, n: int, where: str = "joint") -> Sequence[int]:
    """Return the indices (from 0) of the joints to show: all n, or joint number 1 to n.

    Raises:
        InputError: the robot has no joint of this number.
    """
    if joint is None:
        return range(n)
    if not isinstance(joint, int | np.integer) or not 1 <= joint <= n:
        raise InputError(f"{joint!r}, expected 1 to {n}", place=where)
    return [joint - 1]
