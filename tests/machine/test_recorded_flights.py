"""Learning from recordings of a real machine, here a simulated one with a recorder of its own."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sdt_drake as sdt
from sdt_drake.analysis.comparison import with_controller
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in
from sdt_drake.io.tables import write_table
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.machine.learn.filter import design_filter
from sdt_drake.machine.learn.loops import loops_of
from sdt_drake.machine.learn.matching import match
from sdt_drake.machine.learn.state import (
    State,
    TrialRecord,
    _refuse_growth,
    count_trials,
    read_state,
    reference_file,
    update,
    write_step,
)
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.run.design import make_design
from sdt_drake.run.simulate import simulate


class Machine:
    """A device that is not what its model says, and its recorder."""

    def __init__(self, design, filter_, first, folder):
        self.design, self.filter, self.first = design, filter_, first
        self.folder, self.count = folder, 0

    def flight(self, learned=None):
        """Time [s], what was asked for and what came [rad]."""
        if learned is None:
            return self.first.time, self.design.reference.tracked.q, self.first.q.copy()
        design = self.design.given(learned)
        run = simulate(design)
        return run.time, design.reference.tracked.q, run.q

    def record(self, flight, *, lead=0.0, step=None, noise=0.0, seed=0, columns=("q_ref", "q")):
        """A file that begins `lead` [s] before the motion, at rest, and goes on after it."""
        time, q_ref, q = flight
        step = step or time[1]
        at = np.arange(round((time[-1] + lead + 0.2) / step) + 1.0) * step - lead
        spread = np.random.default_rng(seed).normal(0, noise, (len(at), 4))

        def sampled(values):
            motion = Motion.from_speeds(time[1], values[0], np.gradient(values, time[1], axis=0))
            inside = np.clip(at, 0, time[-1])
            smooth = interpolated(inside, time, values)
            return smooth if step == time[1] else motion.trajectory.vector_values(inside).T

        values = {"q_ref": sampled(q_ref), "q": sampled(q) + spread}
        self.count += 1
        path = self.folder / f"recorded_{self.count}.csv"
        write_table(path, at + lead, {name: values[name] for name in columns})
        return path

    def read(self, path):
        return read_recording(path, self.design.device.simulated, needs=("q",))

    def taught(self, flight, count, noise):
        """What so many noisy recordings of a first flight teach."""
        paths = [self.record(flight, noise=noise, seed=i) for i in range(count)]
        state = State([], [LearnedReference(self.design.reference.tracked)])
        return update(self.design, self.filter, state, [self.read(path) for path in paths])


@pytest.fixture(scope="module")
def made(designed):
    """A design, its filter, and its first flight."""
    base = designed("wrong_model", end=1.5)
    planned = base.reference.planned
    v = planned.v * np.clip((1.5 - planned.time) / 0.8, 0, 1)[:, None]  # ends at rest
    wanted = Motion.from_speeds(planned.period, planned.q[0], v)
    scenario = with_controller(base.scenario, "p_pi")
    design = make_design(scenario, robot=base.nominal, motion=wanted)
    filter_ = design_filter(design, loops_of(design, "reference"), "reference")
    return design, filter_, simulate(design)


@pytest.fixture
def machine(made, tmp_path):
    return Machine(*made, tmp_path)


@pytest.mark.parametrize(
    ("lead", "step", "columns", "off"),
    [
        (0.0, None, ("q_ref", "q"), 1e-9),
        (0.1234, 0.001, ("q_ref", "q"), 2e-5),
        (0.1234, 0.001, ("q",), 1.1e-3),  # to a sample
    ],
)
def test_planned_motion_is_found_in_a_recording(machine, lead, step, columns, off):
    flight = machine.flight()
    path = machine.record(flight, lead=lead, step=step, columns=columns)
    design = machine.design
    found = match(machine.read(path), design, machine.filter, [design.reference.tracked])
    assert found.shift == pytest.approx(lead, abs=off)
    assert found.reference == (0 if "q_ref" in columns else -1)
    np.testing.assert_allclose(found.q, flight[2], rtol=0, atol=3e-6 + 2 * off)


def test_learning_step_from_recordings_equals_simulated_one(machine):
    """Two steps: errors shrink as fast, and the best is kept when one grows."""
    folder = machine.folder / "state"
    design, scores, learned = machine.design, [], None
    for number in (1, 2):
        path = machine.record(machine.flight(learned), lead=0.05)
        state = read_state(folder, design)
        taught = update(design, machine.filter, state, [machine.read(path)])
        write_step(folder, design, state, taught)
        learned = LearnedReference.from_csv(reference_file(folder, number + 1))
        scores.append(taught.trial.score)
    assert scores[1] < 0.1 * scores[0]
    state = read_state(folder, design)
    assert len(state.trials) == 2 and state.best is state.trials[1]
    motions = [reference.motion for reference in state.references]
    first = machine.read(machine.folder / "recorded_1.csv")
    assert match(first, design, machine.filter, motions).reference == 0
    worse = machine.flight(state.references[1])
    worse[2][:, 3] += 0.001 * np.sin(5 * worse[0])
    before = {file: file.read_bytes() for file in folder.iterdir()}
    with pytest.raises(InputError, match=r"has grown .*best so far: reference_02.csv"):
        update(design, machine.filter, state, [machine.read(machine.record(worse))])
    assert {file: file.read_bytes() for file in folder.iterdir()} == before


def test_repeated_error_is_separated_from_noise(machine):
    """Of eight noisy recordings: the floor is the noise, what repeats is the error without it."""
    flight, noise = machine.flight(), 3e-5
    taught = machine.taught(flight, 8, noise)
    np.testing.assert_allclose(taught.trial.floor, noise, rtol=0.1)
    true = np.sqrt(np.mean((machine.design.reference.planned.q - flight[2]) ** 2, axis=0))
    np.testing.assert_allclose(taught.trial.rms, true, rtol=0.05, atol=0.4 * noise)
    quiet = machine.flight()
    quiet[2][:] = machine.design.reference.planned.q
    taught = machine.taught(quiet, 3, noise)
    assert "noise" in {one.kind for one in taught.findings}
    np.testing.assert_allclose(taught.trial.floor, noise, rtol=0.1)
    quiet[2][:, 1] += 1.5 * noise  # within the noise of all joints, but not within its own
    assert "noise" not in {one.kind for one in machine.taught(quiet, 3, noise).findings}
    quiet[2][:] = machine.design.reference.planned.q + noise
    taught = machine.taught(quiet, 3, noise)
    np.testing.assert_allclose(taught.trial.rms, noise, rtol=0.1)
    # A larger error that noise may have made is no growth.
    best, larger = ([x] * 4 for x in (1e-5, 2e-5))
    best = TrialRecord(largest=best, rms=best, floor=[noise] * 4, recordings=3)
    larger = TrialRecord(largest=larger, rms=larger)
    _refuse_growth(larger, State([best], []), Path("a.csv"))
    with pytest.raises(InputError, match="the error has grown"):
        _refuse_growth(larger, State([replace(best, floor=[])], []), Path("a.csv"))


def test_recordings_of_other_motions_or_with_gaps_are_refused(machine):
    recorded = machine.read(machine.record(machine.flight()))
    q, q_ref = recorded.signals["q"], recorded.signals["q_ref"]
    rows, other = np.arange(len(q)), [3, 1, 2, 0]
    for kept, changed, words in (
        (rows, {"q": q[:, other], "q_ref": q_ref[:, other]}, "q_ref is up to .* recording of one"),
        (rows, {"q": q[:, other]}, "joint 1 is .* order of the joints"),
        (np.delete(rows, slice(100, 110)), {}, "a gap from 0.495 to 0.55 s"),
        (rows[::8], {}, "a sample every 0.04 s, expected at most 0.024 s"),
        (rows[:220], {}, "contains 0.000 to 1.095 s of the motion"),
        (rows[:100], {}, "lasts 0.495 s, expected the whole motion"),
    ):
        signals = {name: x[kept] for name, x in {**recorded.signals, **changed}.items()}
        part = replace(recorded, time=recorded.time[kept], signals=signals)
        with pytest.raises(InputError, match=words):
            match(part, machine.design, machine.filter, [machine.design.reference.tracked])
    path, columns = machine.record(machine.flight(), step=0.02), Columns(time_factor=1e-3)
    short = read_recording(path, machine.design.device.simulated, columns, needs=("q",))
    with pytest.raises(InputError, match=r"lasts 0.0017 s, .*; in seconds .* time_factor: 1 in"):
        match(short, machine.design, machine.filter, [machine.design.reference.tracked])


def test_concurrent_updates_keep_both_flights(good, desk):
    """One after the other: a flight of a reference is one of it, whoever comes first."""
    file, state = "../given/cascade.yaml", desk / "state"
    for number, mass in enumerate((30, 30.001, 29.999)):
        changed = ("--set", f"plant.deviation.payload_mass={mass}")
        good("simulate", file, *changed, "--out", f"{number}.csv")
    good("learn", "update", "state", "0.csv", "--scenario", file)
    line = ("learn", "update", "state")
    with alone_in(state, pytest.fail):
        command = [sys.executable, "-m", "sdt_drake", *line, "1.csv"]
        other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert "waiting for another" in other.stdout.readline()
        assert not (state / "flight_02.yaml").exists()
    good(*line, "2.csv")
    out, _ = other.communicate()
    assert other.returncode == 0, out
    assert len(list(state.glob("flight_*"))) == len(list(state.glob("reference_*"))) == 3
    flown = [load_yaml(TrialRecord, state / f"flight_0{i}.yaml")[0].reference for i in (2, 3)]
    assert flown == [2, 2]


def test_learn_update_in_python_equals_command(good, desk):
    file = "../given/cascade.yaml"
    good("simulate", file, "--set", "plant.deviation.payload_mass=30", "--out", "0.csv")
    good("learn", "update", "by_command", "0.csv", "--scenario", file)
    step = sdt.learn_update("by_python", ["0.csv"], scenario=sdt.load(file))
    names = {"scenario.yaml", "flight_01.yaml", "reference_02.csv"}
    for folder in (desk / "by_command", desk / "by_python"):
        assert {one.name for one in folder.iterdir()} == names
    for name in names:
        assert (desk / "by_command" / name).read_bytes() == (desk / "by_python" / name).read_bytes()
    assert step.best == step.made.trial and step.best.score > 0
    assert step.reference == Path("by_python/reference_02.csv")
    for state, options, words in (
        ("by_python", {"scenario": sdt.load(file)}, "scenario: by_python contains scenario.yaml"),
        ("by_python", {"motion": "leans"}, "motion: leans: is not the motion of the scenario"),
        ("new", {}, "scenario: missing, expected the scenario of the first flight, since new is"),
    ):
        with pytest.raises(InputError, match=words):
            sdt.learn_update(state, ["0.csv"], **options)
    assert count_trials(desk / "by_python") == 1 and not (desk / "new").exists()


def test_spike_and_cut_last_line_are_noted_and_not_learned(machine):
    """A spike, as a logger's mark, and a last line that was cut off."""
    path = machine.record(machine.flight())
    state = State([], [LearnedReference(machine.design.reference.tracked)])
    clean = update(machine.design, machine.filter, state, [machine.read(path)])
    rows = [line.split(",") for line in path.read_text().splitlines()]
    rows[150][-1] = "0.5"
    path.write_text("\n".join(map(",".join, rows))[:-30])
    taught = update(machine.design, machine.filter, state, [machine.read(path)])
    notes = "\n".join(map(str, taught.findings))
    assert "last line is incomplete" in notes and "q_4: 1 value(s) far from all around" in notes
    off = np.abs(taught.step.learned.motion.q - clean.step.learned.motion.q).max()
    assert off < 1e-6
