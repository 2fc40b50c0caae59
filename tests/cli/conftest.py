"""A working directory for bad use."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def files():
    """Texts of bad_use.yaml by the names of their files."""
    import yaml

    text = Path(__file__).with_name("bad_use.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["files"]


@pytest.fixture(scope="session")
def tables(tmp_path_factory):
    """A folder with recordings that have too little for some commands."""
    import numpy as np

    from sdt_drake.io.tables import write_table

    folder = tmp_path_factory.mktemp("tables")
    time = np.arange(251) * 0.005
    angles = np.outer(time, [0.2, 0.4, -0.1, 0.3])
    moved = np.sin(np.pi * time / time[-1])[:, None] ** 2 * [0.01, 0.02, 0.02, 0.05]
    write_table(folder / "moved.csv", time, {"v_ref": moved})
    write_table(folder / "all.csv", time, {"q": angles, "q_ref": angles, "tau": angles})
    write_table(folder / "speeds.csv", time, {"v": angles})
    write_table(folder / "three.csv", time, {"q": angles[:, :3], "q_ref": angles[:, :3]})
    write_table(folder / "long.csv", np.array([0, 1800.5, 3601]), {"q": angles[:3]})
    return folder


@pytest.fixture
def crowded(desk, files, tables):
    """A working directory with files to read, those of bad_use.yaml, and files in the way."""
    from helpers.command_line import ARM, SDF

    robots = {
        "negative.sdf": SDF.replace("<mass>300</mass>", "<mass>-300</mass>", 1),
        "headless.sdf": SDF.replace('<frame name="head"', '<frame name="face"'),
        "weak.sdf": ARM.replace("<effort>100", "<effort>40"),
    }
    for name, text in (files | robots).items():
        (desk.parent / "given" / name).write_text(text, encoding="utf-8")
    for folder in ("folder.png", "used"):
        (desk / folder).mkdir()
    for name in ("file", "file.csv", "used/notes.txt", "cam.csv"):
        (desk / name).write_text("mine")
    (desk / "other.html").write_text("<p>mine</p>")
    for path in tables.iterdir():
        shutil.copy(path, desk)
    return desk
