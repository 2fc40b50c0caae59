"""A folder with short motions, base scenarios, and studies on them."""

import shutil
from pathlib import Path

import pytest

from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study


def _written(folder: Path) -> Path:
    from helpers.small_studies import write_files

    write_files(folder)
    return folder


@pytest.fixture(scope="session")
def files(once) -> Path:
    """Read only: motions short and fast, bases axis and coupled, studies of 6 and 16 runs."""
    return once("files", _written)


@pytest.fixture
def desk(tmp_path, monkeypatch) -> Path:
    """The same, as the working directory and to be changed."""
    (tmp_path / "desk").mkdir()
    monkeypatch.chdir(tmp_path / "desk")
    return _written(tmp_path / "desk")


@pytest.fixture(scope="session")
def undisturbed(files, once) -> Path:
    """many.yaml by one process, from beginning to end; read only."""

    def make(folder):
        run_study(make_job(*load_study(files / "many.yaml")), folder / "many")
        return folder / "many"

    return once("undisturbed", make)


@pytest.fixture
def copied(undisturbed, tmp_path) -> Path:
    """The same, to be changed."""
    return shutil.copytree(undisturbed, tmp_path / "copied")
