"""Recordings in other tools' files: what is written is read back, by us and by those tools."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest

from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.io.formats import BINARY
from sdt_drake.run.simulate import RECORDED_COLUMNS, Recording

N, TIME = 3, np.arange(5) * 0.005
NAMES = [name for name in RECORDED_COLUMNS if name != "speed_error"]


@pytest.fixture
def recording():
    values = np.random.default_rng(1).normal(size=(len(NAMES), 5, N))
    return Recording(time=TIME, **dict(zip(NAMES, values, strict=True)))


def needing(suffix):
    return pytest.importorskip({".mat": "scipy.io", ".parquet": "pyarrow.parquet"}[suffix])


@pytest.mark.parametrize("suffix", [".csv", *BINARY])
def test_a_recording_is_read_back_exactly(recording, tmp_path, suffix):
    file = tmp_path / f"run{suffix}"
    if suffix in BINARY:
        needing(suffix)
    recording.save(file)
    again = Recording.load(file)
    for name in ("time", *NAMES):
        np.testing.assert_array_equal(getattr(again, name), getattr(recording, name))


def test_other_tools_find_the_columns(recording, tmp_path):
    scipy_io, parquet = needing(".mat"), needing(".parquet")
    recording.save(tmp_path / "run.mat")
    found = scipy_io.loadmat(tmp_path / "run.mat")
    assert found["tau_cmd"].shape == (5, N) and found["time"].shape == (5, 1)
    np.testing.assert_array_equal(found["speed_error"], recording.speed_error)
    recording.save(tmp_path / "run.parquet")
    table = parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names[:3] == ["time", "v_ref_1", "v_ref_2"]
    np.testing.assert_array_equal(table["q_3"].to_numpy(), recording.q[:, 2])


@pytest.mark.parametrize("suffix", BINARY)
def test_what_is_refused(recording, tmp_path, suffix):
    needing(suffix)
    file = tmp_path / f"run{suffix}"
    file.write_text("time,q_1\n")
    with pytest.raises(InputError, match=f"cannot be read as {suffix} "):
        Recording.load(file)
    file.unlink()
    dataclasses.replace(recording, time=TIME[::-1]).save(file)
    with pytest.raises(InputError, match=f"run{suffix}, row 2: time goes from 0.02 to 0.015 s"):
        Recording.load(file)
    with pytest.raises(InputError, match=r"run\.xlsx: unknown kind of file, expected \.csv, \.mat"):
        recording.save(tmp_path / "run.xlsx")
    dataclasses.replace(recording, q=np.full((5, N), np.nan)).save(file)
    with pytest.raises(InputError, match=f"run{suffix}, row 1: q_1 is nan, expected a finite"):
        Recording.load(file)


def test_parquet_without_its_package(recording, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"is not installed: pip install 'sdt_drake\[exchange\]'"):
        recording.save(tmp_path / "run.parquet")
    assert not any(tmp_path.iterdir())


def test_commands_write_and_read_them(tmp_path, monkeypatch, capsys, short_scenario):
    needing(".mat")
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", short_scenario, "--out", "run.mat"]) == 0
    assert main(["simulate", short_scenario, "--out", "run.csv"]) == 0
    capsys.readouterr()
    told = []
    for name in ("run.mat", "run.csv"):
        assert main(["pilot", name]) == 0
        told.append(capsys.readouterr().out)
    assert told[0] == told[1] and "could be felt" in told[0]
    assert main(["view", "run.mat", "--record", "a.html"]) == 0


@pytest.fixture
def short_scenario(tmp_path):
    still = "\n".join("  - !Knots {knots: [[0, 0], [0.25, 0.1], [0.5, 0]]}" for _ in range(4))
    (tmp_path / "motion.yaml").write_text(f"duration: 0.5\njoints:\n{still}\n")
    (tmp_path / "scenario.yaml").write_text("motion: motion.yaml\ncontroller: {omega_r: 66}\n")
    return "scenario.yaml"
