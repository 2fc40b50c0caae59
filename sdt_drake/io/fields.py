"""Models of files: frozen dataclasses whose fields contain their rules, checked by pydantic.

Each rule stands once, at its field. It applies to files, to objects made in Python, and to the
reference:

    @dataclass(frozen=True)
    class Drive(Input):
        '''The drive between controller and motor, ideal by default.'''

        period: Positive | None = field(None, unit="s")
        '''Sampling period of the speed loop.'''
        n1: EachJoint[Positive] | None = field(None, unit="rad/s", side="motor")
        '''Motor speed up to which the full torque is available.'''

        def problems(self):  # rules between fields; called only if each field is valid
            if self.n1 is not None and self.period is None:
                yield "n1", "needs period"

An object is checked once, when it is made: from a file, in Python, or by `changed`. It cannot
change afterwards: lists become tuples. Only the number of joints is known later: `check_joints`.
"""

import dataclasses
import functools
import re
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar, cast

import numpy as np
from annotated_types import GroupedMetadata
from pydantic import (
    BeforeValidator,
    Field,
    GetCoreSchemaHandler,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from sdt_drake.io.errors import MAX_PROBLEMS, InputError, Problem, at_most
from sdt_drake.io.messages import problems_of, refused
from sdt_drake.io.names import given_fields, leaves, put
from sdt_drake.io.resources import beside
from sdt_drake.io.schema import CONFIG, adapter, expected, schema_of

T = TypeVar("T")

Problems = Iterator[tuple[str, str]]
"""Violated rules between fields: the dotted name of a field, and a text."""

_MAX_MISSING, _MAX_MAPPINGS = 1000, 20_000  # names of no file, and mappings of models, in a file
_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+")  # text in YAML 1.1


class FromHere(str):
    """A path relative to the working directory, not to the folder of the file."""


# --- types of fields -------------------------------------------------------------------------


def _folder(info: ValidationInfo) -> Path | None:
    """Return the folder of the file that is read; None for an object made in Python."""
    return (info.context or {}).get("folder")


def _number(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str) and _folder(info) and _EXPONENT.fullmatch(value):
        value = float(value)
    if most := at_most(value):
        raise PydanticCustomError("beyond", "beyond", {"most": most})
    return value


Number = Annotated[float, BeforeValidator(_number)]
"""A number of at most MAX_NUMBER. Truth values and texts are refused, except 1e3 in a file."""
Positive = Annotated[float, Field(gt=0), BeforeValidator(_number)]
NotNegative = Annotated[float, Field(ge=0), BeforeValidator(_number)]
Integer = Annotated[int, BeforeValidator(_number)]
Text = Annotated[str, Field(min_length=1)]
if TYPE_CHECKING:
    Values = Sequence[T]
else:
    Values = list[T]  # pydantic checks a list; objects have a tuple of it
"""A list in files; any sequence or array in Python."""
NonEmpty = Annotated[Values[T], Field(min_length=1)]
"""A list with at least one entry."""
Names = Annotated[
    Values[str],
    BeforeValidator(lambda value: [value] if isinstance(value, str) else value),
    Field(json_schema_extra={"type": ["array", "string"]}),
]
"""A list of texts. A single text is read as a list with one entry."""
NonEmptyNames = Annotated[Names, Field(min_length=1)]
_PER_JOINT = Field(json_schema_extra={"per_joint": True})
EachJointOrNone = Annotated[Values[T], _PER_JOINT]
"""A list with one value for each joint of the robot, or an empty list."""
EachJoint = Annotated[EachJointOrNone[T], Field(min_length=1)]
"""A list with one value for each joint of the robot."""


@dataclass(frozen=True)
class FileOf(GroupedMetadata):
    """The path or short name of a file of a kind, see `SHIPPED` in `sdt_drake.io.resources`.

    Relative paths start in the folder of the YAML file.
    """

    kind: str

    def __iter__(self) -> Iterator[object]:
        return iter((BeforeValidator(self._placed), Field(json_schema_extra={"file": self.kind})))

    def _placed(self, text: Any, info: ValidationInfo) -> Any:
        folder = _folder(info)
        if not isinstance(text, str) or folder is None:
            return text
        folder = Path.cwd() if isinstance(text, FromHere) else folder
        context = cast(dict[str, Any], info.context)
        if (missing := context.get("missing", 0)) == _MAX_MISSING:
            return text  # the whole object is refused already
        try:
            return beside(str(text), folder, self.kind, similar=missing < MAX_PROBLEMS)
        except InputError as error:
            context["missing"] = missing + 1
            raise refused(*error.problems) from None


class ByTag:
    """A union of models, of which the tag of a mapping (`!Name`) chooses one; else the first."""

    def __get_pydantic_core_schema__(self, union: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        models = {_tag(model): handler.generate_schema(model) for model in typing.get_args(union)}

        def tag(data: Any) -> str:
            first = next(iter(models))
            return str(data.get("_tag", first)) if isinstance(data, dict) else _tag(type(data))

        return core_schema.tagged_union_schema(models, tag)


def _tag(model: type) -> str:
    return f"!{model.__name__}"


def field(default: Any = MISSING, *, unit: str = "", side: str = "", **rules: Any) -> Any:
    """Declare a field of a model. A field without default is required.

    Args:
        default: default value; for a model, its class or a function that makes it.
        unit: unit of numbers; "-" for shares, factors and counts.
        side: "joint" or "motor", where it matters.
        rules: arguments of pydantic's `Field`.
    """
    extra: dict[str, Any] = {name: text for name, text in (("unit", unit), ("side", side)) if text}
    rules["json_schema_extra"] = extra
    if callable(default):
        return dataclasses.field(default_factory=functools.cache(default), metadata=rules)
    return dataclasses.field(default=default, metadata=rules)


class Input:
    """Base class of all models. Models are frozen dataclasses; their objects fit their rules."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    __pydantic_config__ = CONFIG

    def __post_init__(self) -> None:
        _made(type(self), dict(given_fields(self)), _name(self), {}, self)

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return a copy with other values of fields.

        Args:
            changes: values by dotted names: {"controller.kind": "p_pi", "controller.zeta[2]": 0.9}.

        Raises:
            InputError: with a line for each problem: field, what was found, what is accepted.
        """
        return _made(type(self), put(self, changes), _name(self), {})

    def complete(self) -> None:
        """Fill in fields that follow from others; called once, with valid fields."""

    def problems(self) -> Problems:
        """Yield violated rules between fields. Each field by itself is valid then."""
        yield from ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema: Any = handler(source)
        if schema["type"] != "dataclass":  # the schema already exists
            return cast(CoreSchema, schema)
        ref = schema.pop("ref")  # now refers to the schema with the rules
        schema |= {"strict": False, "post_init": False}  # accept mappings, too
        return core_schema.with_info_wrap_validator_function(cls._read, schema, ref=ref)

    @classmethod
    def _read(cls, data: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        """Return the object of a mapping of its fields, or an object itself, which fits already."""
        if type(data) is cls:
            return data
        if data is None and _folder(info):
            data = {}  # a key without a value: "friction:"
        if not isinstance(data, dict):
            raise PydanticCustomError("model", "no model")
        if next((info.context or {})["mappings"]) >= _MAX_MAPPINGS:  # each may have many problems
            raise refused(Problem(f"more than {_MAX_MAPPINGS} mappings"))
        tag = data.get("_tag", _tag(cls))
        if tag != _tag(cls):
            raise refused(Problem(f"unknown kind {tag}", _tag(cls)))
        thing = read({name: _plain(value) for name, value in data.items() if name != "_tag"})
        vars(thing).update({name: _frozen(value) for name, value in vars(thing).items()})
        thing.complete()
        problems: list[Problem] = []
        try:
            problems.extend(Problem(text, place=place) for place, text in thing.problems())
        except InputError as error:
            problems += error.problems
        if problems:
            raise refused(*problems)
        return thing


class Variant(Input):
    """Base class of the models that files choose by a tag."""


# --- the check -------------------------------------------------------------------------------


def check_joints(thing: Input, where: str | Path, n: int) -> None:
    """Check that each list with one value for each joint has `n` values.

    Args:
        thing: an object of a model.
        where: prefix of the messages.
        n: number of joints of the robot.

    Raises:
        InputError: one problem for each wrong list.
    """
    problems = [
        Problem(f"{len(value)} value(s)", f"{n}, one for each joint", name, f"{where}")
        for name, field, value in leaves(thing)
        if _is_per_joint(field.type) and value and len(value) != n
    ]
    if problems:
        raise InputError(*problems)


def _is_per_joint(hint: Any) -> bool:
    """Check whether the type of a field is marked as a list with one value for each joint."""
    return hint is _PER_JOINT or any(map(_is_per_joint, typing.get_args(hint)))


def made(schema: type[T], data: Any, file: Path) -> T:
    """Make an object of a model from the content of a YAML file.

    Args:
        schema: the model.
        data: the content of the file.
        file: path of the file; relative paths in it start in its folder.

    Raises:
        InputError: one problem for each wrong field: its name, its value, and what is accepted.
    """
    if data is None:
        raise InputError(Problem("empty", expected(schema_of(cast(Any, schema))), where=str(file)))
    return _made(schema, data, str(file), {"folder": file.resolve().parent})


def _made(
    schema: type[T], data: Any, where: str, context: dict[str, Any], instance: Any = None
) -> T:
    """Make an object of a model, or fill the fields of `instance`."""
    context = {**context, "mappings": count()}
    validator = adapter(cast(Any, schema)).validator
    try:
        return cast(T, validator.validate_python(data, context=context, self_instance=instance))
    except ValidationError as error:
        problems = [*problems_of(error, schema, where, is_file="folder" in context)]
    raise InputError(*problems)


def _name(thing: Input) -> str:
    """Return the name of an object in messages: "scenario 'axis_pi'", or "drive" without one."""
    kind = re.sub(r"\B[A-Z]", r" \g<0>", type(thing).__name__).lower()
    name = getattr(thing, "name", "")
    return f"{kind} '{name}'" if name else kind


def _plain(data: Any) -> Any:
    """Convert tuples and arrays to lists, and numbers of numpy to those of Python."""
    if isinstance(data, np.ndarray | np.generic):
        return data.tolist()
    return [*map(_plain, data)] if isinstance(data, list | tuple) else data


def _frozen(data: Any) -> Any:
    """Convert lists to tuples."""
    return tuple(map(_frozen, data)) if isinstance(data, list) else data
