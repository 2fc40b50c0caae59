"""Models of files: dataclasses whose fields say what they take, checked by pydantic.

A rule stands once, at its field, for files, for objects made in Python, and for the reference:

    @dataclass
    class Drive(Input):
        '''Everything is ideal unless given.'''

        period: Positive | None = setting(None, unit="s")
        '''Sampling period of the speed loop.'''
        n1: EachJoint[Positive] | None = setting(None, unit="rad/s", side="motor")
        '''Motor speed up to which the full torque is available.'''

        def problems(self):  # rules between fields; only asked where each field is right
            if self.n1 is not None and self.period is None:
                yield "n1", "needs period"

Fields may be assigned anything in Python, other names are refused; `check` looks at the whole
object.
"""

import dataclasses
import difflib
import functools
import re
import typing
from collections.abc import Collection, Iterable, Iterator
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, cast

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError, core_schema

from sdt_drake.io.errors import InputError, Problem, dotted, meant
from sdt_drake.io.resources import beside
from sdt_drake.io.schema import CONFIG, Schema, adapter, expected, inner, schema_of

T = TypeVar("T")

Problems = Iterator[tuple[str, str]]
"""What is wrong between fields of an object: the dotted name of one, and what would be right."""

_LONGEST = 60  # letters of a value that is told
_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")  # a number, but a text to YAML 1.1


class FromHere(str):
    """A text whose relative path starts in the working directory, wherever it stands."""


# --- types of fields -------------------------------------------------------------------------


def _folder(info: ValidationInfo) -> Path | None:
    """The folder of the file that is read; None for an object made in Python."""
    return (info.context or {}).get("folder")


def _number(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str) and _folder(info) and _EXPONENT.fullmatch(value):
        return float(value)
    return value


def _of_each_joint(values: list[T], info: ValidationInfo) -> list[T]:
    n = (info.context or {}).get("n")
    if n is not None and values and len(values) != n:
        raise _refused(Problem(f"{len(values)} value(s)", f"{n}, one for each joint"))
    return values


Number = Annotated[float, BeforeValidator(_number)]
"""A finite number; no truth value, and no text but 1e3 of a file."""
Positive = Annotated[float, Field(gt=0), BeforeValidator(_number)]
NotNegative = Annotated[float, Field(ge=0), BeforeValidator(_number)]
Text = Annotated[str, Field(min_length=1)]
Some = Annotated[list[T], Field(min_length=1)]
"""A list that is not empty."""
Names = Annotated[
    list[str],
    BeforeValidator(lambda value: [value] if isinstance(value, str) else value),
    Field(json_schema_extra={"type": ["array", "string"]}),
]
"""A list of texts; one text stands for a list of it."""
SomeNames = Annotated[Names, Field(min_length=1)]
EachJointOrNone = Annotated[
    list[T], AfterValidator(_of_each_joint), Field(json_schema_extra={"per_joint": True})
]
"""A list with one value for each joint of the robot, or none at all."""
EachJoint = Annotated[EachJointOrNone[T], Field(min_length=1)]
"""A list with one value for each joint of the robot."""


@dataclass(frozen=True)
class OneOf:
    """Some texts, of which a field takes one."""

    choices: Collection[str]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.literal_schema(list(self.choices))


@dataclass(frozen=True)
class FileOf:
    """The name of a file of a kind, of `sdt_drake.io.resources.SHIPPED` where some ship; relative
    paths start in the folder of the YAML file."""

    kind: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.with_info_before_validator_function(self._placed, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> Schema:
        return handler(schema) | {"file": self.kind}

    def _placed(self, text: Any, info: ValidationInfo) -> Any:
        folder = _folder(info)
        if not isinstance(text, str) or folder is None:
            return text
        folder = Path.cwd() if isinstance(text, FromHere) else folder
        try:
            return beside(str(text), folder, self.kind)
        except InputError as error:
            raise _refused(*error.problems) from None


class Tagged:
    """A union of models of which the tag of a mapping (`!Name`) chooses one; the first without."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        options = typing.get_args(source)
        first = _tag(options[0])

        def tag(data: Any) -> str:
            return str(data.get("_tag", first)) if isinstance(data, dict) else _tag(type(data))

        schemas = {_tag(option): handler.generate_schema(option) for option in options}
        return core_schema.tagged_union_schema(schemas, tag)


def _tag(schema: type) -> str:
    return f"!{schema.__name__}"


def setting(default: Any = MISSING, *, unit: str = "", side: str = "", **rules: Any) -> Any:
    """A field of a model; it must be given if it has no default.

    Args:
        default: a model makes its own.
        unit: of numbers; "-" for shares, factors and counts.
        side: "joint" or "motor", where that makes a difference.
        rules: of pydantic's `Field`.
    """
    extra: dict[str, Any] = {name: text for name, text in (("unit", unit), ("side", side)) if text}
    if isinstance(default, type):
        made: dict[str, Any] = {"default_factory": default}
    elif isinstance(default, list):
        made, extra["default"] = {"default_factory": functools.partial(list, default)}, default
    else:
        made = {"default": default}
    return dataclasses.field(**made, metadata={"json_schema_extra": extra, **rules})


class Input:
    """Base class of the models, which are dataclasses."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    __pydantic_config__ = CONFIG

    def __setattr__(self, name: str, value: Any) -> None:
        fields = self.__dataclass_fields__
        if name not in fields and not hasattr(type(self), name):
            text = f"{type(self).__name__} has no field '{name}', {suggestion(name, fields)}"
            raise AttributeError(text)
        super().__setattr__(name, value)

    def problems(self) -> Problems:
        """Rules between fields that are right by themselves."""
        yield from ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema: Any = handler(source)
        if schema["type"] != "dataclass":  # the model is known already
            return cast(CoreSchema, schema)
        ref = schema.pop("ref")  # which now means all of this
        schema["strict"] = False  # mappings are taken, too
        ruled = core_schema.no_info_after_validator_function(_ruled, schema)
        return core_schema.with_info_before_validator_function(cls._opened, ruled, ref=ref)

    @classmethod
    def _opened(cls, data: Any, info: ValidationInfo) -> dict[str, Any]:
        """The fields by name, of a mapping or of an object."""
        if type(data) is cls:
            return dict(given_fields(data))
        if data is None and _folder(info):
            return {}  # "friction:" and nothing below it
        if not isinstance(data, dict) or not _folder(info):
            raise PydanticCustomError("model", "no model")
        tag = data.get("_tag", _tag(cls))
        if tag != _tag(cls):
            raise _refused(Problem(f"unknown kind {tag}", _tag(cls)))
        return {name: value for name, value in data.items() if name != "_tag"}


class Variant(Input):
    """Base class of the models that a tag chooses; files have the tag."""


def given_fields(thing: Any) -> Iterator[tuple[str, Any]]:
    """Fields of an object; what is missing by default is not given, either."""
    for field in dataclasses.fields(thing):
        value = _plain(getattr(thing, field.name))
        if value is not None or field.default is not None:
            yield field.name, value


def _ruled(thing: Input) -> Input:
    """Ask a model for its rules between fields."""
    problems: list[Problem] = []
    try:
        for place, text in thing.problems():
            problems.append(Problem(text, place=place))
    except InputError as error:
        problems += error.problems
    if problems:
        raise _refused(*problems)
    return thing


# --- the check -------------------------------------------------------------------------------


def check(thing: object, where: str = "", n: int | None = None) -> None:
    """Hold an object made in Python against the rules of its model.

    Args:
        thing: an instance of a model.
        where: what errors start with.
        n: number of joints of the robot; lists for each joint may have any length without it.

    Raises:
        InputError: with each problem: field, value, and what would be right.
    """
    _made(type(thing), thing, where, {"n": n})


def made(schema: type[T], data: Any, file: Path) -> T:
    """The object of a model that the content of a YAML file describes.

    Args:
        schema: the model.
        data: the content.
        file: gives the folder that relative paths start from.

    Raises:
        InputError: as `check`, and for fields that there are none of, or that are missing.
    """
    if data is None:
        raise InputError(Problem("empty", expected(schema_of(cast(Any, schema))), where=str(file)))
    return _made(schema, data, str(file), {"folder": file.resolve().parent})


def _made(schema: type[T], data: Any, where: str, context: dict[str, Any]) -> T:
    try:
        return cast(T, adapter(cast(Any, schema)).validate_python(data, context=context))
    except ValidationError as error:
        problems = [
            problem._replace(where=where)
            for one in error.errors(include_url=False)
            for problem in _told(one, schema, is_file="folder" in context)
        ]
    raise InputError(*problems)


def _refused(*problems: Problem) -> PydanticCustomError:
    return PydanticCustomError("refused", "refused", {"problems": problems})


def _told(error: ErrorDetails, schema: type, *, is_file: bool) -> Iterator[Problem]:
    """What pydantic found, in our words: what is accepted follows from the JSON Schema."""
    kind, data, names = error["type"], error["input"], error["loc"]
    is_unknown = kind == "unexpected_keyword_argument"
    place, node = _found(schema, names[:-1] if is_unknown else names)
    accepted = expected(node)
    if is_unknown:
        yield unknown(dotted(place, f"{names[-1]}"), f"{names[-1]}", node["properties"])
    elif kind == "refused":
        for problem in error["ctx"]["problems"]:
            yield problem._replace(place=dotted(place, problem.place))
    elif kind == "missing":
        yield Problem("missing", accepted, place)
    elif kind == "union_tag_invalid" and isinstance(data, dict):
        yield Problem(f"unknown kind {error['ctx']['tag']}", accepted, place)
    elif kind in ("too_short", "too_long") and data:
        yield Problem(f"{len(data)} value(s)", f"{node['minItems']}", place)
    elif kind == "model" and not is_file:
        yield Problem(_shown(data), f"a {node['title']}", place)
    elif kind == "finite_number":
        yield Problem(_shown(data), accepted.replace("a ", "a finite ", 1), place)
    else:
        yield Problem(_shown(data), accepted, place)


def _found(schema: type, names: Iterable[int | str]) -> tuple[str, Schema]:
    """The dotted place of a field, and its JSON Schema."""
    place, top = "", schema_of(schema)
    node = top
    for name in names:
        if isinstance(name, int):
            place, node = f"{place}[{name + 1}]", {"unit": node.get("unit", "-"), **node["items"]}
        elif name.startswith("!"):
            node = top["$defs"][name[1:]]
        else:
            place, node = dotted(place, name), node["properties"][name]
        node = inner(node, top)
    return place, node


def _plain(data: Any) -> Any:
    """Python's own numbers and lists for those of numpy."""
    if isinstance(data, np.ndarray | np.generic):
        return data.tolist()
    return [_plain(value) for value in data] if isinstance(data, list | tuple) else data


def _shown(value: Any) -> str:
    if value in (None, "", []):
        return "empty"
    if isinstance(value, int) and abs(value) >= 2**64:
        return "a whole number of more than 64 bits"
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


# --- names -----------------------------------------------------------------------------------


def given(thing: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of all fields of an object that are not as by default."""
    default = type(thing)()
    for name, value in given_fields(thing):
        if dataclasses.is_dataclass(value):
            yield from given(value, f"{prefix}{name}.")
        elif value != getattr(default, name):
            yield prefix + name, value


def unknown(place: str, name: str, known: Collection[str]) -> Problem:
    """The problem of a name that no field has."""
    near = tuple(difflib.get_close_matches(name, known, n=3))
    return Problem("no such field", f"one of {', '.join(known)}", place, near=near)


def suggestion(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """The known name that is like a wrong one, for people: "did you mean 'kind'?"; or else
    `otherwise`, by default all that is known."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=3)
    if near:
        return meant(near)
    return otherwise or f"expected one of {', '.join(known)}"
