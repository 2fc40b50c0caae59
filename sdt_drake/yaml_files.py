"""Typed YAML with errors that say where.

Drake's `yaml_load_typed` does the loading. It refuses unknown keys, but does not say where they
are, and it takes a few wrong types for right ones; so the raw data is held against the schema
first.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
import types
import typing
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml  # of Drake itself
from pydrake.common.yaml import yaml_load_data, yaml_load_typed

from sdt_drake.errors import InputError, has_control_characters, read_text
from sdt_drake.resources import find_file

T = TypeVar("T")


_MOST_BYTES = 1_000_000  # more takes minutes
_MOST_NODES = 1_000_000  # values, lists and mappings, with what aliases repeat
_LONGEST_TEXT = 10_000  # letters
_TEXT_KEYS = ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge")
_DEEPEST = 50  # lists and mappings in each other


def load_yaml(schema: type[T], path: str | Path) -> tuple[T, Path]:
    """The object of dataclass `schema` that a YAML file describes, and the file's path.

    Raises:
        InputError: naming the file, the field by its dotted name, and what would be right.
    """
    file = find_file(path)
    text, data = _read(file)
    _check(schema, data, str(file), "")
    try:
        return yaml_load_typed(schema=schema, data=text), file
    except (RuntimeError, TypeError, ValueError, AssertionError) as error:
        raise InputError(f"{file}: {' '.join(str(error).split())}") from None


def read_yaml(path: Path) -> Any:
    """What a YAML file holds, as lists, dicts, texts and numbers.

    Raises:
        InputError: naming the file: not UTF-8, not YAML, too large, a key that is given twice.
    """
    return _read(path)[1]


def _read(file: Path) -> tuple[str, Any]:
    """Text and content."""
    text = read_text(file, _MOST_BYTES)
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        _checked_size(node, str(file), {}, 0)
        _check_keys(node, str(file))
        return text, yaml_load_data(text)
    except InputError:
        raise
    except RecursionError:
        raise _too_large(str(file)) from None
    except Exception as error:  # the YAML library raises many kinds, all about the text
        raise InputError(f"{file}: not valid YAML, {' '.join(str(error).split())}") from None


def _checked_size(node: yaml.Node | None, file: str, sizes: dict[int, int], depth: int) -> int:
    """How many nodes there are, this one included. `sizes`: of those that are known."""
    if depth > _DEEPEST:  # an alias within itself, too
        raise _too_large(file)
    if isinstance(node, yaml.CollectionNode):
        if id(node) not in sizes:
            inner = node.value
            if isinstance(node, yaml.MappingNode):
                inner = [part for pair in node.value for part in pair]
            size = 1 + sum(_checked_size(part, file, sizes, depth + 1) for part in inner)
            if size > _MOST_NODES:
                raise _too_large(file)
            sizes[id(node)] = size
        return sizes[id(node)]
    if node is not None:
        text, line = node.value, node.start_mark.line + 1
        if len(text) > _LONGEST_TEXT:
            raise InputError(
                f"{file}, line {line}: {len(text)} letters, expected at most {_LONGEST_TEXT}"
            )
        if has_control_characters(re.sub(r"[\t\n]", "", text)):
            raise InputError(f"{file}, line {line}: control characters in a text, expected letters")
    return 1


def _too_large(file: str) -> InputError:
    return InputError(
        f"{file}: too large, expected at most {_MOST_NODES} values and {_DEEPEST} levels"
    )


def check_types(thing: object, schema: type) -> None:
    """Hold an object that was built in code against its dataclass, as a file is.

    Raises:
        InputError: naming the field and what would be right.
    """
    _check(schema, _raw(thing), "", "")


def _raw(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _raw(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [_raw(item) for item in value] if isinstance(value, (list, tuple)) else value


def _check(schema: Any, data: Any, file: str, name: str) -> None:
    """Hold raw YAML against a type, at the dotted `name`; `file` is "" for what is no file."""
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        options = [a for a in arguments if a is not type(None)]
        if data is None and len(options) < len(arguments):
            return
        option = _option(options, data, file, name)
        if isinstance(data, dict):
            data = {key: value for key, value in data.items() if key != "_tag"}
        _check(option, data, file, name)
    elif origin is list:
        if not isinstance(data, list):
            raise _wrong(file, name, data, "a list")
        for i, item in enumerate(data):
            _check(arguments[0], item, file, f"{name}[{i + 1}]")
    elif dataclasses.is_dataclass(schema):
        _check_fields(schema, data, file, name)
    elif schema is float:
        if not _is_number(data) or (isinstance(data, str) and not file):
            raise _wrong(file, name, data, "a number")
    elif schema is int:
        if isinstance(data, bool) or not isinstance(data, int):
            raise _wrong(file, name, data, "a whole number")
    elif schema is bool:
        if not isinstance(data, bool):
            raise _wrong(file, name, data, "true or false")
    elif schema is str and not isinstance(data, str):
        raise _wrong(file, name, data, "a text")


def _check_fields(schema: Any, data: Any, file: str, name: str) -> None:
    hints = typing.get_type_hints(schema)
    if not isinstance(data, dict):
        raise _wrong(file, name, data, f"a mapping with {', '.join(hints)}")
    for key, value in data.items():
        if key == "_tag":
            raise InputError(f"{file}: {name or 'top level'}: {value} has no meaning here")
        dotted = f"{name}.{key}" if name else key
        if key not in hints:
            near = difflib.get_close_matches(key, hints, n=2)
            meant = f"did you mean {' or '.join(near)}?" if near else "expected one of"
            known = "" if near else f" {', '.join(hints)}"
            raise InputError(f"{file}: {dotted}: unknown field, {meant}{known}")
        _check(hints[key], value, file, dotted)


def _check_keys(node: yaml.Node | None, file: str, name: str = "") -> None:
    """Refuse keys that are no texts, and repeated ones, of which YAML would take the last one."""
    if isinstance(node, yaml.SequenceNode):
        for i, item in enumerate(node.value):
            _check_keys(item, file, f"{name}[{i + 1}]")
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            dotted = f"{name}.{key.value}".lstrip(".")
            if key.tag not in _TEXT_KEYS:
                raise InputError(
                    f"{file}, line {key.start_mark.line + 1}: {dotted}: no text to YAML, which "
                    "takes yes, no, on and off for truth values; expected the name of a field"
                )
            if str(key.value) in seen:
                raise InputError(f"{file}, line {key.start_mark.line + 1}: {dotted} is given twice")
            seen.add(str(key.value))
            _check_keys(value, file, dotted)


def _option(options: list[Any], data: Any, file: str, name: str) -> Any:
    """The member of a union that the YAML tag (`!Name`) chooses; the first one without a tag."""
    tag = data.get("_tag") if isinstance(data, dict) else None
    if tag is None:
        return options[0]
    by_tag = {f"!{option.__name__}": option for option in options}
    if tag not in by_tag:
        raise InputError(f"{file}: {name}: unknown kind {tag}, expected {', '.join(by_tag)}")
    return by_tag[tag]


def _is_number(data: Any) -> bool:
    if isinstance(data, bool):
        return False
    try:
        float(data)  # a str too: YAML 1.1 takes 1e3 for a text, Drake takes it for a number
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def _wrong(file: str, name: str, data: Any, expected: str) -> InputError:
    where = ": ".join(filter(None, (file, name)))
    found = "empty" if data is None and not name else repr(data)
    return InputError(f"{where}: {found}, expected {expected}")
