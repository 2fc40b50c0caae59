"""Bad use of every command: one line, exit code 2, nothing printed or written.

The command lines are those of bad_use.yaml. Messages are compared with the files in test_bad_use/;
`--regen-all` renews them.
"""

import shlex
from pathlib import Path

import pytest
import yaml
from helpers.command_line import is_one_line
from helpers.every_command import EVERY, POSITIONAL
from pydrake.systems.analysis import Simulator

from sdt_drake.cli.app import commands
from sdt_drake.io.resources import models_dir

TABLE = yaml.safe_load(Path(__file__).with_name("bad_use.yaml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("", "COMMAND"),
        ("explode", "reproduce, init, list"),
        ("simulat", 'Did you mean "simulate"?'),
        ("simulate", "SCENARIO"),
        ("plan --wide", "--wide (see sdt-drake plan --help)"),
        ("init ''", "empty, expected a path"),
    ],
)
def test_wrong_usage_names_help(refuse, line, word):
    assert "--help" in refuse(*shlex.split(line), saying=[word])


@pytest.fixture
def nothing_simulated(monkeypatch):
    """Mistakes are told before a minute is spent."""

    def advance(*_):
        raise AssertionError("computed in vain")

    monkeypatch.setattr(Simulator, "AdvanceTo", advance)


@pytest.mark.parametrize("kind", TABLE["lines"])
def test_bad_use_is_one_committed_line(kind, call, crowded, nothing_simulated, file_regression):
    before = times(crowded.parent)
    said = []
    for line in TABLE["lines"][kind]:
        done = call(*shlex.split(line))
        assert done.code == 2 and done.out == "", line
        assert is_one_line(done.err), (line, done.err)
        assert times(crowded.parent) == before, line
        said.append(f"$ {line}\n{done.err.removeprefix('sdt-drake: ')}")
    text = "\n".join(said).replace(str(crowded.parent), "FOLDER")
    text = text.replace(str(models_dir()), "MODELS")
    file_regression.check(text, basename=kind.replace(" ", "_"))


def times(folder):
    """All files below a folder, and when they were written."""
    return {path: path.is_file() and path.stat().st_mtime_ns for path in folder.rglob("*")}


NONSENSE = "non\nsense"


def options_of(name):
    """All options of a command or subcommand, from its signature."""
    app = commands(name.split()[0])
    for word in name.split():
        app = app[word]
    names = [x for argument in app.assemble_argument_collection() for x in argument.names]
    found = {x for x in names if x.startswith("--") and not x.startswith(("--no-", "--empty-"))}
    assert found or name in ("reproduce report", "list")
    return sorted(found)


@pytest.mark.parametrize("name", EVERY)
def test_every_option_refuses_nonsense(name, call, crowded, nothing_simulated):
    before = times(crowded.parent)
    for option in options_of(name):
        others = POSITIONAL.get(name, "").split()
        kept = [x for k, x in enumerate(others) if option not in (x, *others[max(k - 1, 0) : k])]
        done = call(*name.split(), *kept, f"{option}={NONSENSE}")
        assert (done.code, done.out) == (2, "") and is_one_line(done.err), (option, done)
        assert option in done.err or "sense" in done.err, (option, done.err)
    assert times(crowded.parent) == before
