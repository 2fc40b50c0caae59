"""A folder with short motions, base scenarios, and studies on them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import sharing
from small_studies import write_files

from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study


@pytest.fixture(scope="session")
def files(_shared_runs) -> Path:
    """Read only: motions short and fast, bases axis and coupled, studies of 6 and 30 runs."""

    def make():
        (folder := sharing.folder / "files").mkdir()
        write_files(folder)
        return folder

    return sharing.once("files", make)


@pytest.fixture
def desk(tmp_path, monkeypatch) -> Path:
    """The same, as the working directory and to be changed."""
    folder = tmp_path / "desk"
    folder.mkdir()
    write_files(folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="session")
def undisturbed(files) -> Path:
    """many.yaml by one process, from beginning to end; read only."""

    def make():
        folder = sharing.folder / "undisturbed" / "many"
        run_study(make_job(*load_study(files / "many.yaml")), folder)
        return folder

    return sharing.once("undisturbed", make)


@pytest.fixture
def copied(undisturbed, tmp_path) -> Path:
    """The same, to be changed."""
    return shutil.copytree(undisturbed, tmp_path / "copied")
