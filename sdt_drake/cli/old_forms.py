"""Command lines of 0.4 in today's form; they work until 0.7."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sdt_drake.cli import SUBCOMMANDS

_FLAGS = ("--judge", "--all", "--trust", "--show", "--resume", "--help", "-h")
_MANY = {"identify": ("--validate",), "learn": ("--recording",)}
"""Options with one or more values by their command."""

_WEIGHTS = {"pi": "1", "p_in_feedback": "0"}
"""Set-point weights by the old names of the structures."""

_Options = list[tuple[str, list[str]]]


def modern(words: Sequence[str]) -> tuple[list[str], str]:
    """Return a command line in today's form, and a line that names the new form of an old one."""
    if not words:
        return [], ""
    command, positional, options = words[0], *_parsed(words)
    given = dict(options)
    own = (positional, [one for one in options if one[0] not in _OWN.get(command, ())])
    if command == "identify" and "--judge" in given:
        return _judge(*own), _line("identify --judge", "judge ROBOT RECORDING")
    if command == "pilot" and "--validate" in given:
        return _joined(["pilot", "validate"], *own), _line("pilot --validate", "pilot validate")
    if command == "pilot" and "--pilots" in given and positional[:1] != ["people"]:
        new = _joined(["pilot", "people"], positional, options)
        return new, _line("pilot MOTION --pilots", "pilot people MOTION --pilots")
    if command == "export" and "--fmu" in given:
        renamed = [
            (new, given[old]) for old, new in (("--fmu", "--out"), ("--fmu-input", "--input"))
            if old in given
        ]  # fmt: skip
        new = _joined(["export", "fmu"], positional, [*renamed, *own[1]])
        return new, _line("export --fmu", "export fmu SCENARIO --out")
    if command == "learn" and "--recording" in given:
        new = ["learn", "update"]
        if "--state" in given:
            new += [*given["--state"], *given["--recording"]]
        scenario = [("--scenario", positional)] * bool(positional)
        return _joined(new, [], [*scenario, *own[1]]), _line(
            "learn --recording --state", "learn update STATE RECORDING"
        )
    if command == "step" and "--structure" in given:
        weight = ("--setpoint-weight", [_WEIGHTS.get(x, x) for x in given["--structure"]])
        new = _joined(["step"], positional, [weight, *own[1]])
        return new, _line("step --structure", "step --setpoint-weight")
    if command == "study" and positional and positional[0] not in SUBCOMMANDS["study"]:
        return ["study", "run", *words[1:]], _line("study STUDY", "study run STUDY")
    return [*words], ""


_OWN = {
    "identify": ("--judge",),
    "pilot": ("--validate",),
    "export": ("--fmu", "--fmu-input"),
    "learn": ("--recording", "--state"),
    "step": ("--structure",),
}
"""Options of old forms by their command."""


def _line(old: str, new: str) -> str:
    return f"'{old}' is '{new}' now; the old form goes in 0.7"


def _judge(positional: list[str], options: _Options) -> list[str]:
    robot, files = positional[:1], positional[1:]
    if files and Path(files[0]).suffix in (".yaml", ".yml"):
        options = [*options, ("--friction", [files.pop(0)])]
    return _joined(["judge"], [*robot, *files], options)


def _joined(command: list[str], positional: Sequence[str], options: _Options) -> list[str]:
    return [*command, *positional, *(word for name, values in options for word in (name, *values))]


def _parsed(words: Sequence[str]) -> tuple[list[str], _Options]:
    """Return the positional words of a command line, and its options with their values."""
    command, *rest = words
    flags = (*_FLAGS, *(["--validate"] * (command == "pilot")))
    positional: list[str] = []
    options: _Options = []
    lacking = 0.0  # values that belong to the last option
    for word in rest:
        if word.startswith("--"):
            name, equals, value = word.partition("=")
            options.append((name, [value] if equals else []))
            many = name in _MANY.get(command, ())
            lacking = 0 if equals or name in flags else float("inf") if many else 1
        elif lacking:
            options[-1][1].append(word)
            lacking -= 1
        else:
            positional.append(word)
    return positional, options
