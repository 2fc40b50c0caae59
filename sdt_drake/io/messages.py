"""Problems of a model in words, from the errors of pydantic and the model's JSON Schema."""

from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from sdt_drake.io.errors import MAX_PROBLEMS, Problem, dotted, suggestion
from sdt_drake.io.names import Schema, inner
from sdt_drake.io.schema import expected, schema_of

_MAX_SHOWN = 60  # characters of a value in messages


def refused(*problems: Problem) -> PydanticCustomError:
    """Return the error of a validator that finds problems; `problems_of` returns them."""
    return PydanticCustomError("refused", "refused", {"problems": problems})


def problems_of(
    error: ValidationError, model: Any, where: str, *, is_file: bool
) -> Iterator[Problem]:
    """Yield the problems that pydantic found in the fields of a model."""
    errors = error.errors(include_url=False)
    for one in errors[:MAX_PROBLEMS]:
        for problem in _told(one, model, is_file=is_file):
            yield problem._replace(where=": ".join(filter(None, (where, problem.where))))
    # The others are only counted, as similar names for each take up to milliseconds.
    yield from [Problem("another problem", where=where)] * (len(errors) - MAX_PROBLEMS)


def _told(error: ErrorDetails, model: Any, *, is_file: bool) -> Iterator[Problem]:
    """Translate an error of pydantic. The accepted values follow from the JSON Schema."""
    kind, data, names = error["type"], error["input"], error["loc"]
    is_unknown = kind == "unexpected_keyword_argument"
    place, node = _found(model, names[:-1] if is_unknown else names)
    found, accepted = "", expected(node)
    if is_unknown:
        name = f"{names[-1]}"
        text = f"no such field, {suggestion(name, node['properties'])}"
        yield Problem(text, place=dotted(place, name))
        return
    if kind == "refused":
        for problem in error["ctx"]["problems"]:
            yield problem._replace(place=dotted(place, problem.place))
        return
    if kind == "missing":
        found = "missing"
    elif kind == "union_tag_invalid" and isinstance(data, dict):
        found = f"unknown kind {error['ctx']['tag']}"
    elif kind in ("too_short", "too_long") and data:
        least, most = node.get("minItems", 0), node.get("maxItems", "more")
        found, accepted = (
            f"{len(data)} value(s)",
            f"{least}" if least == most else f"{least} to {most}",
        )
    elif kind == "model" and not is_file:
        accepted = f"a {node['title']}"
    elif kind == "finite_number":
        accepted = accepted.replace("a ", "a finite ", 1)
    elif kind == "beyond":
        accepted += error["ctx"]["most"]
    yield Problem(found or _shown(data), accepted, place)


def _found(model: Any, names: Iterable[int | str]) -> tuple[str, Schema]:
    """Return the dotted name of a field and its JSON Schema."""
    place, top = "", schema_of(model)
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


def _shown(value: Any) -> str:
    if value in (None, "", []):
        return "empty"
    if isinstance(value, int) and abs(value) >= 2**64:
        return "a whole number of more than 64 bits"
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."
