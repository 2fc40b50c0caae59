"""Reading and writing of YAML files, as plain data and as objects of models."""

import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import yaml

from sdt_drake.io.errors import InputError, dotted, one_line, within
from sdt_drake.io.fields import FromHere, Input, Variant, made
from sdt_drake.io.files import has_control_characters, read_text, write_text
from sdt_drake.io.names import given_fields, put
from sdt_drake.io.resources import a_kind, find_file

T = TypeVar("T")

_MAX_BYTES = 1_000_000
_MAX_VALUES = 200_000  # read in 5 s; counts lists, mappings, keys, and each use of an alias
_MAX_TEXT = 10_000  # characters
_MAX_DEPTH = 50  # nested lists and mappings
_TOO_LARGE = f"too large, expected at most {_MAX_VALUES} values and {_MAX_DEPTH} levels"
_TEXT, _MERGE = "tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"


def load_yaml(
    schema: type[T], path: str | Path, kind: str = "", changes: Mapping[str, Any] | None = None
) -> tuple[T, Path]:
    """Read an object of a model from a YAML file. Its `name`, if it has one, is that of the file.

    Args:
        schema: the model, see `sdt_drake.io.fields`.
        path: the file, or the short name of a shipped one.
        kind: kind of the file; the keys of SHIPPED in `sdt_drake.io.resources` have short names.
        changes: values by dotted names that replace or complete those of the file.

    Returns:
        The object, and the path of the file.

    Raises:
        InputError: one line for each problem: file, dotted name of the field, value, and what is
            accepted.
    """
    file = find_file(path, kind)
    if (suffix := file.suffix.lower()) in _NO_YAML:
        raise InputError(f"{path}: is {_NO_YAML[suffix]}, expected {a_kind(kind or 'YAML file')}")
    data = read_yaml(file)
    keys = set(data) if isinstance(data, dict) else set()
    if kind in _KEYS and not keys & _KEYS[kind]:
        for other in (name for name, own in _KEYS.items() if keys & own):
            raise InputError(f"{path}: is {a_kind(other)}, expected {a_kind(kind)}")
    if isinstance(data, dict):
        data = put(data, _from_here(changes or {}))
        if hasattr(schema, "name") and data.get("name", "") == "":
            data["name"] = file.stem
    return made(schema, data, file), file


_NO_YAML = {".sdf": "a robot", ".urdf": "a robot", ".xacro": "a robot", ".csv": "a table"}
_KEYS = {
    "scenario": {"controller", "plant"},
    "motion": {"tracks", "joints"},
    "study": {"variables", "requirements"},
    "motors": {"motors"},
    "drives": {"axes"},
    "stops": {"category", "deceleration", "limits", "motors", "ramp"},
    "acceptance tests": {"frequencies", "limits", "repeats", "steps"},
    "perception model": {"k_w", "k_fw", "k_fg", "k_a"},
    "columns of a flight": {"force", "omega", "force_unit", "omega_unit", "axes", "lever"},
}
"""Keys that identify the kind of a file."""


def _from_here(value: Any) -> Any:
    """Mark the paths in a value as relative to the working directory."""
    if isinstance(value, Mapping):
        return {name: _from_here(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(map(_from_here, value))
    return FromHere(value) if isinstance(value, str) else value


def parse_yaml(text: str) -> Any:
    """Read a YAML text, see `read_yaml`.

    Raises:
        InputError: no YAML, too large, or a repeated key.
    """
    try:
        return deepcopy(_parsed(text))
    except InputError:
        raise
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f"not valid YAML, {one_line(error)}") from None


@lru_cache(maxsize=8)  # studies read the same catalogue for every row
def _parsed(text: str) -> Any:
    return _Reader(text).data()


def read_yaml(file: Path) -> Any:
    """Read a YAML file as lists, dicts, texts and numbers.

    The result equals that of Drake's own loader. The tag of a mapping becomes its `_tag`. Top-level
    keys that start with an underscore are ignored, so that they can contain anchors.

    Raises:
        InputError: no UTF-8, no YAML, too large, or a repeated key. The message has the file.
    """
    text = read_text(file, _MAX_BYTES)
    with within(file):
        data = parse_yaml(text)
    if not isinstance(data, dict):
        return data
    return {key: data[key] for key in data if key == "_tag" or not key.startswith("_")}


def write_yaml(path: str | Path, thing: object) -> None:
    """Write an object of a model as a YAML file for `load_yaml`, atomically.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(Path(path), yaml_text(thing))


def yaml_text(
    thing: object,
    changes: Mapping[str, Any] | None = None,
    comments: Mapping[str, str] | None = None,
) -> str:
    """Return an object of a model as YAML, without the fields left at None.

    Args:
        thing: the object.
        changes: other values by dotted names. They are not checked: files may not exist here.
        comments: comments by dotted names, at the ends of lines; that of "" comes first.
    """
    return with_comments(_dumped(put(thing, changes or {})), comments or {})


def with_values(text: str, values: Mapping[str, Any]) -> str:
    """Return a YAML text with other values of its fields. Comments stay.

    Args:
        text: the text; the old values are on one line each.
        values: objects of models or plain data, by dotted names.
    """
    for name, value in values.items():
        key, old = _nodes(text)[name]
        start, end = key.start_mark.index, old.end_mark.index
        first, *others = _dumped({key.value: value}).rstrip("\n").split("\n")
        rest, after = text[end:].split("\n", 1)
        lines = [first + rest, *(" " * key.start_mark.column + line for line in others)]
        text = text[:start] + "\n".join([*lines, after])
    return text


def with_comments(text: str, comments: Mapping[str, str]) -> str:
    """Return a YAML text with a comment at the end of the line of each named field.

    The lines of the comment of "" come before the text.
    """
    lines, nodes = text.split("\n"), _nodes(text)
    for name, comment in comments.items():
        if name:
            lines[nodes[name][0].start_mark.line] += f"  # {one_line(comment)}"
    head = [f"# {line}" for line in comments.get("", "").splitlines()]
    return "\n".join([*head, *lines])


def _nodes(text: str) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    """Return the nodes of key and value of all fields of a YAML text by dotted name."""

    def within(node: yaml.Node | None, place: str) -> Iterator[tuple[str, yaml.Node, yaml.Node]]:
        children: list[tuple[str, yaml.Node, yaml.Node]] = []
        if isinstance(node, yaml.MappingNode):
            children = [(dotted(place, key.value), key, value) for key, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            children = [(f"{place}[{i + 1}]", item, item) for i, item in enumerate(node.value)]
        for child in children:
            yield child
            yield from within(child[2], child[0])

    return {name: (key, value) for name, key, value in within(yaml.compose(text), "")}


def _dumped(data: Any) -> str:
    return yaml.dump(
        data,
        Dumper=_Writer,
        sort_keys=False,
        allow_unicode=True,
        width=100,
        default_flow_style=None,
    )


class _Writer(yaml.SafeDumper):
    """A writer of models that puts lists of numbers and texts on one line."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent(self, data: Any) -> None:
        node = self.represent_data(data)
        node.flow_style = False  # type: ignore  # a field of the file on each line
        self.serialize(node)


def _represented(writer: _Writer, thing: Any) -> yaml.Node:
    tag = f"!{type(thing).__name__}" if isinstance(thing, Variant) else writer.DEFAULT_MAPPING_TAG
    values = {name: value for name, value in given_fields(thing) if value is not None}
    return writer.represent_mapping(tag, values)


def _tagged(writer: _Writer, data: dict[str, Any]) -> yaml.Node:
    """Represent a mapping with its tag, as `parse_yaml` returns it."""
    tag = data.get("_tag", writer.DEFAULT_MAPPING_TAG)
    return writer.represent_mapping(tag, {key: data[key] for key in data if key != "_tag"})


_Writer.add_multi_representer(Input, _represented)
_Writer.add_representer(dict, _tagged)


class _Reader(yaml.SafeLoader):
    """A reader that refuses large files and repeated keys."""

    def data(self) -> Any:
        """Return the content of the only document."""
        self.depth = self.n_nodes = self.n_values = 0
        self.read: dict[yaml.Node, tuple[Any, int]] = {}  # value of a node, number of values in it
        node = self.get_single_node()
        return None if node is None else self._value(node, "", 0)

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self.depth += 1
        self.n_nodes += 1
        if self.depth > _MAX_DEPTH + 2 or self.n_nodes > _MAX_VALUES:  # before reading the rest
            raise InputError(_TOO_LARGE)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def _value(self, node: yaml.Node, name: str, depth: int) -> Any:
        before = self.n_values
        value, count = self.read.get(node, (None, 1))
        self.n_values += count
        if depth > _MAX_DEPTH or self.n_values > _MAX_VALUES:  # also an alias within itself
            raise InputError(_TOO_LARGE)
        if node not in self.read:
            value = self._new_value(node, name, depth)
            self.read[node] = value, self.n_values - before
        return value

    def _new_value(self, node: yaml.Node, name: str, depth: int) -> Any:
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, name, depth)
        if isinstance(node, yaml.SequenceNode):
            if node.tag != self.DEFAULT_SEQUENCE_TAG:
                raise _wrong(node, name, f"{node.tag} on a list, expected it on a mapping")
            items = enumerate(node.value)
            return [self._value(item, f"{name}[{i + 1}]", depth + 1) for i, item in items]
        if len(node.value) > _MAX_TEXT:
            raise _wrong(node, name, f"{len(node.value)} characters, expected at most {_MAX_TEXT}")
        if has_control_characters(re.sub(r"[\t\n]", "", node.value)):
            raise _wrong(node, name, "control characters in a text; remove them")
        try:
            return self.construct_object(node)
        except yaml.YAMLError:
            raise
        except Exception:  # the library raises many types
            kind = node.tag.rpartition(":")[2]
            text = f"'{node.value[:40]}' cannot be read as !!{kind}"
            raise _wrong(node, name, text) from None

    def _mapping(self, node: yaml.MappingNode, name: str, depth: int) -> dict[str, Any]:
        merged: dict[str, Any] = {}
        own: dict[str, Any] = {}
        for key, inner in node.value:
            if key.tag not in (_TEXT, _MERGE):
                text = key.value if isinstance(key, yaml.ScalarNode) else "of several values"
                raise _wrong(
                    key,
                    name,
                    f"the key {text} is no text in YAML (yes, no, on and off are truth values), "
                    "expected the name of a field",
                )
            place = dotted(name, key.value)
            value = self._value(inner, place, depth + 1)
            if key.tag == _MERGE:
                for part in reversed(value if isinstance(value, list) else [value]):
                    if not isinstance(part, dict):
                        raise _wrong(key, place, "expected a mapping to merge")
                    merged.update(part)
            elif self._value(key, name, depth) in own:
                raise _wrong(key, place, "is given twice")
            else:
                own[key.value] = value
        tag = {} if node.tag == self.DEFAULT_MAPPING_TAG else {"_tag": node.tag}
        return merged | own | tag


def _wrong(node: yaml.Node, name: str, text: str) -> InputError:
    place = f"line {node.start_mark.line + 1}"
    return InputError(f"{place}: {name}: {text}" if name else f"{place}: {text}")
