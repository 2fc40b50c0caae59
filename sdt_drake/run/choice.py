"""The union of the options of all controllers, of which `kind` chooses one."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any, cast

import numpy as np
from pydantic import (
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
)
from pydantic_core import CoreSchema, core_schema

from sdt_drake.io.errors import Problem
from sdt_drake.io.fields import FileOf, Input, Problems, Text
from sdt_drake.io.messages import refused
from sdt_drake.io.names import Schema, given_fields
from sdt_drake.io.schema import adapter
from sdt_drake.run.options import CONTROLLERS, SAME, ControllerOptions, canonical, load_controllers
from sdt_drake.systems.gains import STRUCTURES


@dataclass(frozen=True)
class _Chosen(Input):
    """Fields that choose the options of a controller."""

    kind: Text = "pi"
    file: Annotated[str, FileOf("controllers")] = ""

    def problems(self) -> Problems:
        if self.file:
            load_controllers(self.file)
        if self.kind not in CONTROLLERS:
            yield "kind", f"'{self.kind}', expected one of {', '.join(CONTROLLERS)}"


def plain_pi() -> ControllerOptions:
    """Return the options of the default kind."""
    return CONTROLLERS[_Chosen.kind]()


class OfKind:
    """The union of all options. It is no union of pydantic's, as `file` adds kinds to it."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.with_info_wrap_validator_function(_options, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> Schema:
        """Merge the fields of all kinds, and name the kinds that take a field."""
        made = handler(schema)
        union = handler.resolve_ref_schema(made)
        properties, takers = union["properties"], dict[str, list[str]]()
        for kind, options in CONTROLLERS.items():
            made_of_kind = handler(adapter(cast(Any, options)).core_schema)
            for name, field in handler.resolve_ref_schema(made_of_kind)["properties"].items():
                if name in takers or name not in properties:  # no option of all controllers
                    takers.setdefault(name, []).append(kind)
                    properties.setdefault(name, field)
        for name, kinds in takers.items():
            properties[name]["description"] += f" Kinds: {', '.join(kinds)}."
        properties["kind"]["examples"] = [*CONTROLLERS]
        properties["structure"] = {
            "type": "string",
            "enum": [*STRUCTURES],
            "default": "",
            "deprecated": True,
            "description": 'Old words for `setpoint_weight`: "pi" is 1, "p_in_feedback" 0.',
        }
        del union["additionalProperties"]  # those of the file's controllers
        union["if"] = {"required": ["file"]}
        union["else"] = {
            "properties": {"kind": {"enum": _and_same([*CONTROLLERS])}},
            "propertyNames": {"enum": [*properties]},
            "dependencies": {
                name: {"properties": {"kind": {"enum": _and_same(kinds)}}}
                | ({} if _Chosen.kind in kinds else {"required": ["kind"]})
                for name, kinds in takers.items()
            },
        }
        return made


def _and_same(kinds: Sequence[str]) -> list[str]:
    return [*kinds, *(name for name, kind in SAME.items() if kind in kinds)]


def _options(data: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
    """Return the options of the kind that a mapping names, or options themselves, which fit."""
    if isinstance(data, ControllerOptions):
        if type(data) is CONTROLLERS.get(data.kind):
            return data
        data = dict(given_fields(data))  # made before the controller was registered
    if isinstance(data, dict) and isinstance(data.get("kind"), str):
        data = {**data, "kind": canonical(data["kind"])}
    if data is None and (info.context or {}).get("folder"):  # a key without a value: "controller:"
        data = {}
    if not isinstance(data, dict):
        return read(data)
    choice = {name: data[name] for name in ("kind", "file") if name in data}
    kind = adapter(_Chosen).validate_python(choice, context=info.context).kind
    options = CONTROLLERS[kind]
    data = _fitting(_in_new_words(data, options), kind)
    return adapter(cast(Any, options)).validate_python(data, context=info.context)


def _in_new_words(data: dict[str, Any], options: type[ControllerOptions]) -> dict[str, Any]:
    """Replace `structure`, a word of version 0.4."""
    if "structure" not in data:
        return data
    data = dict(data)
    word = data.pop("structure")
    if not isinstance(word, str) or word not in STRUCTURES:
        raise refused(Problem(f"{word!r}", "setpoint_weight instead, 0 to 1", "structure"))
    new = f"setpoint_weight: {STRUCTURES[word]:g}"
    if "setpoint_weight" in {field.name for field in fields(options)}:
        data["setpoint_weight"] = STRUCTURES[word]
        new = f"write {new}"
    else:
        new = "remove it: this kind takes no setpoint_weight"
    text = f"controller.structure: {word} is deprecated and goes in 0.7, {new}"
    warnings.warn(text, FutureWarning, stacklevel=2)
    return data


def _fitting(data: dict[str, Any], kind: str) -> dict[str, Any]:
    """Leave out defaults of options that other kinds take, and refuse other values of them."""
    fitting, problems = dict(data), []
    defaults: dict[str, dict[str, Any]] = {}
    for other, options in CONTROLLERS.items():
        for field in fields(options):
            defaults.setdefault(field.name, {})[other] = field.default
    for name in [name for name in data if kind not in defaults.get(name, {kind})]:
        value = fitting.pop(name)
        if np.ndim(value) or value not in defaults[name].values():
            takers = ", ".join(defaults[name])
            problems.append(Problem(f"{kind} takes none, only {takers}", place=name))
    if problems:
        raise refused(*problems)
    return fitting
