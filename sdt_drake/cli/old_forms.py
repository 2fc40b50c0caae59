"""Command lines of 0.4 in today's form; they work until 0.7."""

from collections.abc import Callable, Sequence
from itertools import takewhile
from pathlib import Path

from sdt_drake.cli import SUBCOMMANDS

_FLAGS = ("--all", "--trust", "--show", "--resume", "--help")
"""Options without a value; all others have one."""

_LINE = "'{}' is '{}' now; the old form goes in 0.7"


def modern(words: Sequence[str]) -> tuple[list[str], str]:
    """Return a command line in today's form, and a line that names the new form of an old one."""
    command, rest = words[:1], list(words[1:])
    names = [word.partition("=")[0] for word in rest]
    for old, (new, form) in _FORMS.items():
        own, *options = old.split()
        is_new = options and {"people", "--only"} & {*names}
        if [own] == command and {*options} <= {*names} and not is_new:
            today = takewhile(lambda word: word.isalpha() and word.islower(), new.split())
            return [*today, *form(rest)], _LINE.format(old, new)
    if command == ["study"] and any(rest[k] not in SUBCOMMANDS["study"] for k in _first(rest)):
        return ["study", "run", *rest], _LINE.format("study STUDY", "study run STUDY")
    return [*words], ""


def _first(words: Sequence[str], skipped: int = 0) -> list[int]:
    """Return the index of the first word that is neither an option nor its value, if there is one.

    `skipped` such words are left out.
    """
    before = ("", *words)
    takes = [word.startswith("--") and "=" not in word and word not in _FLAGS for word in before]
    plain = [k for k, x in enumerate(words) if not x.startswith("--") and not takes[k]]
    return plain[skipped : skipped + 1]


def _judge(words: list[str]) -> list[str]:
    words.remove("--judge")
    files = [k for k in _first(words, 1) if Path(words[k]).suffix in (".yaml", ".yml")]
    friction = [x for k in files for x in ("--friction", words.pop(k))]
    return [*words, *friction]


def _update(words: list[str]) -> list[str]:
    from argparse import ArgumentParser

    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--recording", nargs="*")
    parser.add_argument("--state", nargs="?")
    given, words = parser.parse_known_args(words)
    scenario = [x for k in _first(words) for x in ("--scenario", words.pop(k))]
    state = [given.state, *given.recording] if given.state else []
    return [*state, *scenario, *words]


def _excited(words: list[str]) -> list[str]:
    k = next(k for k, word in enumerate(words) if word.startswith("--payload"))
    behind = words[k + 1 : k + 2]
    has_link = "=" in words[k] or (behind != [] and not behind[0].startswith("--"))
    return [*words[:k], "--only", "payload", *words[k if has_link else k + 1 :]]


def _renamed(words: list[str], names: dict[str, str]) -> list[str]:
    parts = (word.partition("=") for word in words)
    return ["".join(names.get(part, part) for part in word) for word in parts]


_FMU = {"--fmu": "--out", "--fmu-input": "--input"}
_WEIGHT = {"--structure": "--setpoint-weight", "pi": "1", "p_in_feedback": "0"}
_RECORD = {"--record": "--out"}
_FORMS: dict[str, tuple[str, Callable[[list[str]], list[str]]]] = {
    "scenarios": ("list", list),
    "motions": ("list motions", list),
    "reference": ("docs files", list),
    "report": ("reproduce report", list),
    "view --record": ("view --out", lambda words: _renamed(words, _RECORD)),
    "excite --payload": ("excite --only payload", _excited),
    "identify --judge": ("judge ROBOT RECORDING", _judge),
    "pilot --validate": ("pilot validate", lambda words: [x for x in words if x != "--validate"]),
    "pilot --pilots": ("pilot people MOTION --pilots", list),
    "export --fmu": ("export fmu SCENARIO --out", lambda words: _renamed(words, _FMU)),
    "learn --recording": ("learn update STATE RECORDING", _update),
    "step --structure": ("step --setpoint-weight", lambda words: _renamed(words, _WEIGHT)),
}
"""New forms by old ones, and functions from the words behind the old command to those behind."""
