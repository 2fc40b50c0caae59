"""Long recordings: memory that follows their rows, and parts of them that are enough."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from known_truth import recorded_of, true_robot

from sdt_drake.io.tables import write_table
from sdt_drake.machine.identify import equations as module
from sdt_drake.machine.identify import procedure
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.filtering import Stretch, spread, stretches
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.run.simulate import Recording


def test_columns_in_blocks_are_those_of_all(robot, monkeypatch):
    (stretch,), _ = stretches(recorded_of(true_robot(robot)))
    arguments = robot, Unknown.everything(robot), [(0, 12.0, stretch)], 4.0
    whole = equations(*arguments)
    monkeypatch.setattr(module, "_BLOCK_SAMPLES", 900)
    parts = equations(*arguments)
    assert len(parts.time) == len(whole.time) and np.all(parts.part == 0)
    for name in ("time", "q", "tau", "known", "nominal", "rigid", "friction"):
        one, other = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(other).max())


def test_windows_are_spread_over_all_of_a_recording():
    """Two stretches of 60 s and 40 s, of which 10 s are enough, below 100 Hz."""
    found = [
        Stretch(start, 0.01, *2 * [np.arange(start, start + lasts, 0.01)[:, None]])
        for start, lasts in ((0.0, 60.01), (80.0, 40.01))
    ]
    assert spread(found, 101.0, 100.0) == found
    windows = spread(found, 10.0, 100.0)
    assert len(windows) == 20 and windows[0].start == 0
    np.testing.assert_allclose(windows[-1].end, 120)
    for window in windows:  # their values are their times
        lasts = window.end - window.start
        assert abs(lasts - 0.5) < 0.011
        np.testing.assert_allclose(window.q[[0, -1], 0], [window.start, window.end])
    assert sum(window.start < 70 for window in windows) == 12
    assert len(spread(found, 1.0, 100.0)) == 2  # of enough periods, rather than short ones


def test_parts_of_a_long_recording_tell_what_all_of_it_does(robot, monkeypatch):
    recorded = recorded_of(true_robot(robot), seconds=120.0)
    whole = identify(robot, [recorded], cutoff=3.0)
    assert not any("evenly spread" in note for note in whole.notes)
    monkeypatch.setattr(procedure, "MAX_ROWS", 600)
    some = identify(robot, [recorded], cutoff=3.0)
    assert "50 s of 120 s are compared, in 3 evenly spread parts" in some.notes
    assert len(some.equations.time) < 0.6 * len(whole.equations.time)
    size = np.sqrt(np.diagonal(some.estimate.covariance))[: len(some.estimate.beta)]
    assert np.all(np.abs(some.estimate.beta - whole.estimate.beta) < 4 * size)


GROWTH = """
import contextlib, io, resource, sys
from sdt_drake.cli.app import main
peaks = []
for file in ("short", "long"):
    with contextlib.redirect_stdout(io.StringIO()):
        assert main([x.replace("FILE", file) for x in sys.argv[1:]]) == 0
    peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
print((peaks[1] - peaks[0]) * (1 if sys.platform == "darwin" else 1024))
"""


def growth(*command: str) -> float:
    """How much more memory [bytes] a command takes with long.csv than with short.csv."""
    program = [sys.executable, "-c", GROWTH, *command]
    return float(subprocess.run(program, check=True, capture_output=True, text=True).stdout)


def test_memory_of_learn_is_six_times_the_numbers(good, desk):
    good("simulate", "../given/cascade.yaml", "--out", "flight.csv")
    flight = Recording.load("flight.csv")
    for name, rows in (("short", 1000), ("long", 150_000)):
        time = 0.001 * np.arange(float(rows))
        q = np.stack([np.interp(time, flight.time, x) for x in flight.q.T], axis=1)
        write_table(f"{name}.csv", time, {"q": q})
    learn = ("learn", "../given/cascade.yaml", "--recording", "FILE.csv", "--state", "FILE")
    assert growth(*learn) < 6 * 8 * 5 * 150_000


def test_memory_of_identify_is_six_times_the_numbers(robot, desk):
    recorded = recorded_of(true_robot(robot), seconds=20.0)
    for name, rows in (("short", 10_000), ("long", 100_000)):
        time = 0.001 * np.arange(float(rows))  # there and back, again and again
        at = 20 - np.abs(time / 5 % 40 - 20)
        signals = {
            signal: np.stack([np.interp(at, recorded.time, x) for x in values.T], axis=1)
            for signal, values in recorded.signals.items()
        }
        write_table(f"{name}.csv", time, signals)
    identify_it = ("identify", "sdt", "FILE.csv", "--only", "friction", "--out", "FILE")
    assert growth(*identify_it) < 6 * 8 * 9 * 100_000
