"""Learning from flights: loop models, filter, convergence, flights, and the command."""

import signal
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import command_line

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.io.errors import InputError
from sdt_drake.machine.learn import trials
from sdt_drake.machine.learn.filter import convergence, design_filter, refuse_divergence
from sdt_drake.machine.learn.loops import (
    POINTS,
    LoopSet,
    demand,
    known_loop,
    loops_of,
    position_response,
)
from sdt_drake.machine.learn.trials import learn, next_step, reason_to_stop, run_trial
from sdt_drake.motion import LearnedReference, Motion, checked_torque
from sdt_drake.run.design import make_design
from sdt_drake.run.simulate import simulate
from sdt_drake.show.figures.learning import errors
from sdt_drake.show.figures.runs import scope
from sdt_drake.show.reports import learning as report
from sdt_drake.studies.devices import devices_of
from sdt_drake.studies.study import load_study

DRIVE = {"drive.period": 0.001, "drive.encoder_resolution": [4194304] * 4}
SPRINGS = {"plant.elasticity.natural_frequency": [0, 75, 0, 0]}


@pytest.fixture
def cascade(designed):
    """A cascade at the start of the motion: joint 1 starts after 0.5 s, joint 4 after 1 s."""

    def make(label="p_pi", fields=None, *, name="coupled_pi", end=1.5):
        base = designed(name, fields, end=end)
        return base.variant(with_controller(base.scenario, label))

    return make


@pytest.mark.parametrize(
    ("label", "fields", "of"),
    [
        ("p_pi", None, "reference"),
        ("p_pi+id", None, "reference"),
        ("pi", None, "reference"),
        ("inverse_dynamics", None, "reference"),
        ("p_pi+id", DRIVE, "reference"),
        ("inverse_dynamics", DRIVE, "reference"),
        ("p_pi+id", {"held_speed": "mean"}, "reference"),
        ("p_pi", SPRINGS, "reference"),
        ("p_pi", {"drive.reference_delay": 0.01}, "reference"),
        ("p_pi", {"drive.reference_delay": 0.0025}, "reference"),
        ("p_pi+id", DRIVE | {"drive.reference_delay": 0.0017}, "reference"),
        ("p_pi", None, "torque"),
    ],
)
def test_loop_answers_a_pulse_as_its_linear_model(cascade, label, fields, of):
    """Of joints 1 and 2 at rest, against the simulation, with what they do to the others."""
    fields = {"accuracy": 1e-7, **(fields or {})}
    base = cascade(label, fields, end=0.4)
    tracked = base.reference.tracked
    period, count = tracked.period, len(tracked.q)
    still = Motion.from_speeds(period, tracked.q[0], np.zeros_like(tracked.q))
    design = make_design(base.scenario, robot=base.nominal, motion=still)
    pulse = np.zeros((count, 4))
    pulse[4:34, :2] = (1 - np.cos(np.linspace(0, 2 * np.pi, 30)))[:, None] / [67.2, 1.0]
    if of == "torque":
        learned = LearnedReference(still, pulse)
    else:
        pulse *= 1e-4
        q = still.q + pulse
        motion = Motion.from_positions(period, np.vstack([q[:1], q, q[-1:]]))
        learned = LearnedReference(motion)
    answer = [simulate(d).q_measured for d in (design.given(learned), design)]

    padded = 4 * count
    omega = 2 * np.pi * np.fft.rfftfreq(padded, period)
    response = position_response(design, 0, np.maximum(omega, 1e-3), of=of)
    spectrum = np.fft.rfft(pulse, padded, axis=0)
    predicted = np.fft.irfft(np.einsum("mij,mj->mi", response, spectrum), padded, axis=0)[:count]
    tolerance = 0.01 * np.abs(predicted).max(axis=0)
    assert np.all(tolerance[:2] > 1e-10)
    tolerance[2:] = tolerance.max()
    assert np.all(np.abs(answer[0] - answer[1] - predicted) <= tolerance)


def test_errors_shrink_by_the_checked_rate(cascade):
    """A loop that is linear and 0.7 times the model's: 0.3 of each error is left by each flight,
    within the bandwidth; above it all is left."""
    design = cascade()
    loops = loops_of(design, "reference")
    filter_ = design_filter(design, loops, "reference")
    time = np.arange(4000) * design.reference.tracked.period
    bell = np.exp(-(((time - 10) / 0.6) ** 2))[:, None] * np.ones(4)
    slow, fast = (bell * np.sin(2 * np.pi * f * time)[:, None] for f in (1.0, 40.0))

    def flown(learned):
        omega = 2 * np.pi * np.fft.rfftfreq(len(time), design.reference.tracked.period)
        spectrum = np.fft.rfft(learned, axis=0)
        for k, inverse in enumerate(filter_.inverse.T):
            spectrum[:, k] *= 0.7 / np.interp(omega, filter_.omega, inverse)
        return np.fft.irfft(spectrum, len(time), axis=0)

    for wanted, left in ((slow, 0.3**3), (fast, 1.0)):
        learned = np.zeros_like(wanted)
        for _ in range(3):
            learned = filter_.next(learned, flown(learned) - wanted)
        share = np.abs(wanted - flown(learned)).max() / np.abs(wanted).max()
        assert share == pytest.approx(left, rel=0.05)

    # A flight starts as the planned motion does, whatever was off there.
    assert not filter_.next(slow, slow + 1.0)[0].any()

    scaled = [0.7 * response for response in loops[0].responses]
    check = convergence(filter_, LoopSet("others", tuple(scaled), loops[0].demand))
    below = filter_.omega < 0.2 * filter_.bandwidth[0].omega
    np.testing.assert_allclose(check.share[below], 0.3, atol=0.02)


def test_unstable_loop_is_refused(cascade):
    """Its speed is that of a link behind a spring; its response says that errors shrink."""
    springs = {"plant.elasticity": {"natural_frequency": [0, 40, 0, 0], "encoder": "link"}}
    with pytest.raises(InputError, match=r"for the model: unstable loop at \d.* s of the motion"):
        loops_of(cascade(fields=springs), "reference")


def test_divergent_loop_is_refused_before_a_flight(cascade):
    design = cascade()
    loops = loops_of(design, "reference")
    filter_ = design_filter(design, loops, "reference")
    lively = [2.2 * response for response in loops[0].responses]
    lively = LoopSet("others", tuple(lively), loops[0].demand)
    check = convergence(filter_, lively)
    assert 1.15 < check.largest < 1.5
    with pytest.raises(InputError, match=r"converge for others: joint \d would keep 1\.\d+ of"):
        refuse_divergence([check], filter_)
    tired = convergence(filter_, replace(loops[0], demand=np.array([[0.5, 1.06, 0.2, 0.3]])))
    with pytest.raises(InputError, match=r"needs 106\.0 % of the torque of motor 2"):
        refuse_divergence([tired], filter_)
    some = np.array([[0.5, 1.06, 0.2, 0.3], [0.5, 0.8, 0.2, 0.3]])
    refuse_divergence([convergence(filter_, replace(loops[0], demand=some))], filter_)
    # A filter that knows of such loops learns less.
    careful = design_filter(design, [*loops, lively], "reference")
    assert careful.bandwidth[1].why == "the spread of the loops"


def test_demand_equals_inverse_dynamics_with_friction_and_disturbance(cascade):
    """Inverse dynamics, friction and disturbance of what moves: no tracking error, no reserve."""
    design = cascade("inverse_dynamics", {"plant.deviation.payload_mass": 40}, end=1.0)
    run = simulate(design)
    expected = run.tau_peak[20:].max(axis=0) / design.device.simulated.motor_torque_limit
    np.testing.assert_allclose(demand(design)[0], expected[0], rtol=0.02)
    shaken = cascade("inverse_dynamics", {"disturbance.amplitude": 0.1}, end=1.0)
    calm = cascade("inverse_dynamics", end=1.0)
    own = calm.device.simulated
    load = np.abs(calm.loads.load_torque * own.gear_ratio / own.effort_limit)
    assert np.all(demand(shaken) <= demand(calm) + 0.1 * load.max(axis=0) + 1e-9)
    assert np.any(demand(shaken) > demand(calm))
    rough = cascade("inverse_dynamics", name="wrong_model", end=1.0)
    assert np.all((demand(rough) > demand(calm))[[0, 2]])  # which move
    speeds = {"drive.n1": [1.0, 0.1, 0.01, 0.01], "drive.n0": [300.0, 3, 3, 3]}
    falling = cascade("inverse_dynamics", speeds, end=1.0)
    own, planned = falling.device.simulated, falling.reference.planned
    w = planned.v * own.gear_ratio
    n1, n0 = (np.array(x) for x in speeds.values())
    left = np.clip((n0 - np.abs(w)) / (n0 - n1), 0, 1)
    torque = falling.torques.total + own.reflected_inertia * planned.vd
    share = np.abs(torque) / own.effort_limit / np.where(torque * w > 0, left, 1)
    np.testing.assert_allclose(demand(falling), share.max(axis=0), rtol=1e-9, atol=1e-12)
    assert np.any(demand(falling) > 1.01 * demand(calm))


def test_learning_bandwidth_is_that_of_structure_or_loop(cascade, designed):
    rigid = cascade()
    by_structure = design_filter(rigid, loops_of(rigid, "reference"), "reference")
    assert [round(b.omega, 3) for b in by_structure.bandwidth] == [65.991] * 4
    slow = cascade("pi")
    by_loop = design_filter(slow, loops_of(slow, "reference"), "reference")
    for k, bandwidth in enumerate(by_loop.bandwidth):
        assert bandwidth.why == "the loop's own bandwidth"
        gain = position_response(slow, 0, np.array([0.9, 1.2]) * bandwidth.omega)[:, k, k]
        assert abs(gain[0]) > 0.5 > abs(gain[1])
    soft = replace(rigid.nominal, frequency_factor=0.5)
    softer = make_design(rigid.scenario, robot=soft, motion=rigid.reference.planned)
    by_structure = design_filter(softer, loops_of(softer, "reference"), "reference")
    assert [round(b.omega, 3) for b in by_structure.bandwidth] == [round(65.991 / 2, 3)] * 4
    tuned = rigid.tuning.gains
    gains = {"kp": tuned.kp, "ki": tuned.ki, "omega_r": None, "zeta": None}
    unknown = rigid.scenario.changed({f"controller.{name}": x for name, x in gains.items()})
    perfect = LoopSet("perfect", (np.tile(np.eye(4), (POINTS, 1, 1)),), np.zeros((1, 4)))
    by_samples = design_filter(replace(rigid, scenario=unknown), [perfect], "reference")
    assert by_samples.bandwidth[0] == (pytest.approx(100 * np.pi), "the sample period")
    with pytest.raises(InputError, match=r"^bandwidth: 100 Hz"):
        design_filter(rigid, loops_of(rigid, "reference"), "reference", bandwidth=200 * np.pi)


def test_flights_of_wrong_model_improve_without_more_torque(cascade):
    design = cascade(name="wrong_model")
    filter_ = design_filter(design, loops_of(design, "reference"), "reference")
    seen = []
    result = learn(design, filter_, 3, stops=False, report=lambda x: seen.append(len(x.trials)))
    first, last = result.trials[0], result.trials[-1]
    assert seen == [trial.number for trial in result.trials] == [1, 2, 3]
    with pytest.warns(DeprecationWarning, match="flights is trials now, and goes in 0.7"):
        assert result.flights is result.trials
    assert first.rms[3] > 20 * last.rms[3]
    assert np.all(last.peak <= 1.02 * first.peak + 0.002)
    motion = last.learned.motion
    checked_torque(design.device.nominal, motion)
    np.testing.assert_array_equal(motion.q[0], design.reference.planned.q[0])
    again = run_trial(design.given(last.learned), 3)
    np.testing.assert_array_equal(again.error, last.error)


def test_elastic_joints_learn_from_encoders_and_report_links(cascade):
    flight, run = run_trial(design := cascade("p_pi", SPRINGS), 1), simulate(design)
    np.testing.assert_array_equal(flight.seen, run.q_measured - design.reference.planned.q)
    np.testing.assert_array_equal(flight.error, run.position_error)
    told = errors("learn", run.time, [flight], design.device.simulated.joint_names)
    shown = np.reshape(scope("simulate", run, design).axes, (4, -1))[2]
    for learned, simulated in zip(told.axes, shown, strict=False):  # of one sign, late is negative
        lines = [*learned.get_lines(), *simulated.get_lines()]
        flown, error = (x.get_ydata() for x in lines if x.get_label() in ("flight 1", "error"))
        np.testing.assert_array_equal(flown, error)
    assert np.mean(flight.error * np.sign(run.v_ref), axis=0).min() < 0
    assert np.abs(flight.seen - flight.error)[:, 1].max() > 1e-4


def test_learned_torque_removes_quick_errors_within_its_limit(cascade):
    design = cascade(name="wrong_model")
    filter_ = design_filter(design, loops_of(design, "torque"), "torque")
    mean = cascade(name="wrong_model", fields={"held_speed": "mean"})
    slower = design_filter(mean, loops_of(mean, "torque"), "torque").lowest
    assert np.all(slower < filter_.lowest / 20)
    first, second = learn(design, filter_, 2, stops=False).trials
    assert second.learned.motion is design.reference.planned
    change = [np.abs(np.diff(flight.error[:, 3])).max() for flight in (first, second)]
    assert change[1] < 0.6 * change[0]
    careful = design.scenario.changed({"torque_margin": 0.5})
    step = next_step(replace(design, scenario=careful), filter_, 100 * first.seen)
    assert "available" in step.limit and step.note == f"torque clipped: {step.limit}"
    most = np.abs(step.learned.torque) / design.device.nominal.motor_torque_limit
    assert most.max() == pytest.approx(0.5)


def test_a_step_beyond_a_limit_is_reduced_to_the_share_within_it(cascade):
    """Of twice the error half as much: both end at the same motion."""
    design = cascade()
    filter_ = design_filter(design, loops_of(design, "reference"), "reference")
    error = 20 * run_trial(design, 1).seen
    one, two = (next_step(design, filter_, factor * error) for factor in (1, 2))
    assert 0 < two.share < one.share < 1 and two.share == pytest.approx(one.share / 2, abs=1e-3)
    assert one.note == f"step reduced to {int(100 * one.share)} %: {one.limit}"
    torque = np.abs(checked_torque(design.device.nominal, one.learned.motion)).max(axis=0)
    assert (torque / design.device.nominal.effort_limit).max() == pytest.approx(1, abs=2e-3)


def test_learning_stops_when_unfelt_unimproved_growing_or_limited():
    def tried(*scores, felt=0.5):
        return [SimpleNamespace(score=score, felt=felt) for score in scores]

    whole = SimpleNamespace(share=1.0, limit="")
    assert reason_to_stop(tried(1.0), []) == ""
    assert reason_to_stop(tried(1.0, 0.5), [whole]) == ""
    assert "cannot be felt" in reason_to_stop(tried(1.0, felt=0.0), [])
    assert "by less than 5 %" in reason_to_stop(tried(1.0, 0.5, 0.49), [whole] * 2)
    assert "has grown" in reason_to_stop(tried(1.0, 0.5, 0.6), [whole] * 2)
    near = SimpleNamespace(share=0.3, limit="joint 2 needs torque")
    assert reason_to_stop(tried(1.0, 0.5), [near]) == "a limit is near: joint 2 needs torque"


def test_known_loop_has_the_controllers_model(cascade):
    model, plant = {"controller.model.payload_mass": -40}, {"plant.deviation.payload_mass": 40}
    known = demand(known_loop(cascade(fields=model | plant)))
    lighter = demand(cascade(fields={"plant.deviation.payload_mass": -40}))
    np.testing.assert_allclose(known, lighter)
    assert np.any(lighter < demand(cascade(fields=plant)))


def test_study_devices_keep_the_controller_of_the_loop(cascade):
    study, base = load_study("monte_carlo")
    devices = devices_of(cascade(), study, base, 2)
    assert [device.scenario.controller.kind for device in devices] == ["p_pi", "p_pi"]
    masses = [device.scenario.plant.deviation.payload_mass for device in devices]
    assert masses == [study.inputs(4 * row)["payload_mass"] for row in range(2)]


def test_learn_writes_files_that_simulate_and_plan_read(good, refuse, desk, undrawn):
    file = "../given/cascade.yaml"
    payload = "plant.deviation.payload_mass=30"
    out = good("learn", file, "--set", payload, "--flights", "2", "--out", "learned").out
    assert "flight 2, largest error" in out and "best: flight 2" in out
    rows = command_line.read_csv(desk / "learned/flights.csv")
    best = dict(zip(rows[0], map(float, rows[2]), strict=True))
    shown = command_line.columns_of(good("simulate", "learned/scenario.yaml").out)["position [deg]"]
    expected = [np.degrees(best[f"max_abs_position_error_{k}"]) for k in (1, 2, 3, 4)]
    np.testing.assert_allclose(command_line.numbers(shown), expected, atol=6e-4)
    good("plan", "learned/learned.csv")
    refuse("learn", "learned/scenario.yaml", "--out", "learned", saying=["is read by this comm"])
    written = {path.name for path in (desk / "learned").iterdir()}
    kept = {name for name in report.ALL_FILES if name.startswith("unfinished/")}
    assert written == {*report.ALL_FILES} - kept


def test_interrupt_in_third_flight_keeps_two(call, good, refuse, desk, undrawn, monkeypatch):
    """While its numbers are written; when finished nothing is kept."""
    command = ("learn", "../given/cascade.yaml", "--all")
    original = report.write_table
    good(*command, "--flights", "2", "--out", "two")

    def interrupted(path, number, *more, **named):
        if np.max(number) == 3:
            signal.raise_signal(signal.SIGINT)
        return original(path, number, *more, **named)

    with monkeypatch.context() as patch:
        patch.setattr(report, "write_table", interrupted)
        done = call(*command, "--out", "five")
    assert (done.code, done.err) == (130, "")
    assert "interrupted; the flights so far are in five/unfinished; to continue" in done.out
    files = {"flights.csv", "learned.csv", "scenario.yaml"}
    kept = {"unfinished", *(f"unfinished/{name}" for name in files)}
    assert set(command_line.snapshot(desk / "five")) == kept
    for name in files:
        assert (desk / "five/unfinished" / name).read_bytes() == (desk / "two" / name).read_bytes()
    refuse(*command, "--out", "five", saying=("five/unfinished: contains flights of an inter",))
    good("learn", "five/unfinished/scenario.yaml", "--flights", "1", "--out", "on")
    before, after = (command_line.read_csv(desk / f"{x}/flights.csv") for x in ("two", "on"))
    assert after[1][1:] == before[2][1:]


def test_every_end_of_learn_names_the_kept_flights(call, desk, undrawn, monkeypatch):
    """An error in the second flight, and Ctrl-C when all is written."""
    command = ("learn", "../given/cascade.yaml", "--flights", "2", "--out")
    own, remove = trials.run_trial, report.remove_unfinished

    def failing(design, number):
        if number == 2:
            raise InputError("no second one")
        return own(design, number)

    with monkeypatch.context() as patch:
        patch.setattr(trials, "run_trial", failing)
        done = call(*command, "failed")
    assert done.code == 2 and "no second one" in done.err
    assert "the flights so far are in failed/unfinished; to continue" in done.out
    stop = [lambda: signal.raise_signal(signal.SIGINT)]
    monkeypatch.setattr(report, "remove_unfinished", lambda x: (stop.pop()(), remove(x)))
    assert call(*command, "done").code == 130
    kept = {name for name in report.ALL_FILES if name.startswith("unfinished/")}
    assert set(command_line.snapshot(desk / "done")) == {*report.ALL_FILES} - kept
