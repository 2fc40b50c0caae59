"""The study, computed and written once for all tests of the analysis."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from sdt_drake.analysis.claims import Claim
from sdt_drake.analysis.report import write_study
from sdt_drake.analysis.study import Stopwatch, Study, run_study


@dataclass(frozen=True)
class Written:
    """A study on disk, and what was told while it was computed and written."""

    folder: Path
    claims: list[Claim]
    told: list[str]


@pytest.fixture(scope="session")
def _study_and_watch() -> tuple[Study, Stopwatch, list[str]]:
    told: list[str] = []
    watch = Stopwatch(told.append)
    return run_study(watch), watch, told


@pytest.fixture(scope="session")
def study(_study_and_watch) -> Study:
    """The paper's study; do not change it."""
    return _study_and_watch[0]


@pytest.fixture(scope="session")
def written(_study_and_watch, tmp_path_factory) -> Written:
    """All files of the study, in a folder that did not exist; do not change them."""
    study, watch, told = _study_and_watch
    folder = tmp_path_factory.mktemp("study") / "not" / "yet"
    return Written(folder, write_study(study, folder, watch), told)


@pytest.fixture
def without_graphviz(monkeypatch, tmp_path) -> None:
    """A PATH with nothing on it."""
    empty = tmp_path / "empty_path"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    assert shutil.which("dot") is None
