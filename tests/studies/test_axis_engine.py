"""The axis engine against the Drake loops that it stands for, and against itself."""

from __future__ import annotations

import copy
import dataclasses
import tracemalloc

import numpy as np
import pytest

from sdt_drake.analysis.tracking import motor_use, period_torque, track
from sdt_drake.design import Design, make_design
from sdt_drake.device import Drive, Elasticity, Friction
from sdt_drake.dynamics import torque_groups
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.scenario import Scenario, load_scenario
from sdt_drake.simulate import simulate
from sdt_drake.studies.axis_engine import (
    METRICS,
    AxisVariants,
    _sine_integrals,
    simulate_axes,
    variants_of,
)

TABLES = ("load_torque", "alleviating_torque", "feedforward")


@pytest.fixture(scope="module")
def short(robot) -> Design:
    """Three joints of the reference device from 4.5 s to 7 s: it speeds up, and turns on."""
    whole = make_design(load_scenario("package://sdt/scenarios/axis_pi_ctc.yaml"), robot=robot)
    start, end = 900, 1400
    motion = whole.motion
    return make_design(
        whole.scenario,
        robot=robot,
        motion=Motion.from_speeds(motion.period, motion.q[start], motion.v[start : end + 1]),
    )


@pytest.fixture(scope="module")
def make(short):
    """A variant of `short`: change(scenario), factor on the motors' torque, on the coupling."""

    def make(change=None, *, torque=1.0, coupling=1.0) -> Design:
        scenario: Scenario = copy.deepcopy(short.scenario)
        if change is not None:
            change(scenario)
        robot, torques = short.robot, short.torques
        return make_design(
            scenario,
            robot=dataclasses.replace(robot, effort_limit=torque * robot.effort_limit),
            motion=short.motion,
            torques=dataclasses.replace(torques, reaction=coupling * torques.reaction),
        )

    return make


def set_to(**values):
    """A change of a scenario: fields of controller, disturbance, plant, or its own, by name."""

    def change(scenario: Scenario) -> None:
        parts = (scenario.controller, scenario.disturbance, scenario.plant, scenario)
        for name, value in values.items():
            owner = next(part for part in parts if hasattr(part, name))
            setattr(owner, name, value)

    return change


def stiffer(short: Design, kp: float, ki: float):
    gains = short.gains
    return set_to(kp=list(kp * gains.kp), ki=list(ki * gains.ki))


def drake_speed(design: Design) -> np.ndarray:
    """Of the Drake loop, its integrator's error put out of the way."""
    return simulate(design, accuracy=1e-9).v


def test_equals_the_drake_loop_to_1e_6_where_nothing_saturates(make):
    designs = [
        make(set_to(kind="pi", structure="p_in_feedback", amplitude=0.0), torque=20),
        make(set_to(kind="pi", structure="pi", amplitude=0.3, omega_d=20.0), torque=20),
        make(torque=20),
        make(set_to(kind="pi_id", algorithm="consistent", amplitude=0.2), torque=20, coupling=5),
        make(set_to(feedforward_gain=[0.5, 0.0, -1.0, 2.0], omega_d=0.0), torque=20),
    ]
    outcomes = simulate_axes(variants_of(designs), record=True)

    assert np.all(outcomes.saturated_fraction == 0)
    for design, recording in zip(designs, outcomes.recordings, strict=True):
        np.testing.assert_allclose(recording.v, drake_speed(design), rtol=0, atol=1e-6)


def hard_cases(short: Design) -> list[tuple]:
    light, heavy = list(0.4 * short.i_eff), list(3 * short.i_eff)
    return [
        (set_to(kind="pi", amplitude=0.3), 0.5),
        (set_to(kind="pi", structure="pi", i_eff=light), 0.6),
        (set_to(i_eff=heavy, amplitude=0.4, omega_d=60.0), 0.4),
        (set_to(algorithm="consistent", amplitude=0.2), 0.6),
        (set_to(kind="pi_id", i_eff=light, amplitude=0.5, omega_d=200.0), 0.6),
        (stiffer(short, 6, 15), 0.6),
        (stiffer(short, 0.1, 1), 0.5),
    ]


def test_equals_the_drake_loop_to_1e_4_where_it_saturates_hard(short, make):
    designs = [make(change, torque=torque, coupling=5) for change, torque in hard_cases(short)]
    outcomes = simulate_axes(variants_of(designs), record=True)

    assert np.all(outcomes.saturated_fraction.max(axis=1) > 0.1)
    consistent, printed = designs[3].loads.load_torque, designs[0].loads.load_torque
    assert np.abs(printed - consistent).max() > 1  # the sign matters here
    for design, recording in zip(designs, outcomes.recordings, strict=True):
        np.testing.assert_allclose(recording.v, drake_speed(design), rtol=0, atol=1e-4)


def test_recording_is_that_of_the_drake_loop(make):
    design = make(set_to(kind="pi", amplitude=0.3), torque=0.8)
    outcomes = simulate_axes(variants_of([design]), record=True)
    drake, engine = simulate(design, accuracy=1e-9), outcomes.recordings[0]

    largest = design.robot.motor_torque_limit.max()
    for name, tolerance in (
        ("time", 0),
        ("q_ref", 0),
        ("v_ref", 0),
        ("q", 1e-6),
        ("v", 1e-5),
        ("tau_cmd", 1e-4 * largest),
        ("tau_limited", 1e-4 * largest),
        ("tau", 1e-4 * largest),
        ("load_torque", 0),
    ):
        expected = getattr(drake, name)
        np.testing.assert_allclose(
            getattr(engine, name), expected, rtol=0, atol=tolerance, err_msg=name
        )


def test_metrics_are_those_of_tracking(short, make):
    designs = [make(torque=20)]
    designs += [make(change, torque=torque) for change, torque in hard_cases(short)]
    outcomes = simulate_axes(variants_of(designs), record=True)

    for k, (design, recording) in enumerate(zip(designs, outcomes.recordings, strict=True)):
        tracking = track(recording, design.motion)
        use = motor_use(period_torque(recording, design), design.robot)
        for name in METRICS:
            expected = getattr(use if "torque" in name else tracking, name)
            actual = getattr(outcomes, name)[k]
            np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-11, err_msg=name)


def random_variants(base: AxisVariants, count: int, seed: int = 0) -> AxisVariants:
    random = np.random.default_rng(seed)
    shape = base.i_eff.shape[1]

    def scaled(values, low, high):
        return values[0] * random.uniform(low, high, (count, shape))

    return dataclasses.replace(
        base,
        gear_ratio=np.repeat(base.gear_ratio[:1], count, axis=0),
        i_eff=scaled(base.i_eff, 0.3, 3),
        kp=scaled(base.kp, 0.2, 4),
        ki=scaled(base.ki, 0.2, 4),
        on_error=random.random(count) < 0.5,
        torque_limit=scaled(base.torque_limit, 0.4, 1.2),
        amplitude=random.uniform(0, 0.4, count),
        omega_d=random.uniform(0, 200, count),
        load_of=random.integers(0, len(base.load_torque), count),
        feedforward_of=random.integers(0, len(base.feedforward), count),
        feedforward_gain=random.uniform(0, 1.2, (count, shape)),
    )


def picked(variants: AxisVariants, which) -> AxisVariants:
    own = [
        field.name
        for field in dataclasses.fields(variants)
        if field.name not in ("motion", *TABLES)
    ]
    return dataclasses.replace(variants, **{name: getattr(variants, name)[which] for name in own})


@pytest.fixture(scope="module")
def base(make) -> AxisVariants:
    consistent = make(set_to(algorithm="consistent"), coupling=5)
    return variants_of([make(coupling=5), consistent, make(set_to(kind="pi"))])


def test_a_variant_does_not_depend_on_the_others(base):
    variants = random_variants(base, 40)
    together = simulate_axes(variants)

    order = np.random.default_rng(1).permutation(40)
    for which in (order[:1], order[1:8], order[8:]):
        apart = simulate_axes(picked(variants, which))
        for name in METRICS:
            expected = getattr(together, name)[which]
            np.testing.assert_array_equal(getattr(apart, name), expected, err_msg=name)


def test_short_steps_change_nothing(base, monkeypatch):
    variants = random_variants(base, 60)
    as_it_is = simulate_axes(variants)
    monkeypatch.setattr("sdt_drake.studies.axis_engine._FASTEST", 0.1)
    finely = simulate_axes(variants)

    assert 0.02 < np.mean(as_it_is.saturated_fraction) < 0.9
    for name in ("max_abs_speed_error", "rms_speed_error", "constant_speed_error"):
        expected = getattr(finely, name)
        np.testing.assert_allclose(getattr(as_it_is, name), expected, rtol=0, atol=5e-5)


def test_memory_does_not_grow_with_the_motion(base):
    def peak(samples: int) -> int:
        motion = base.motion
        cut = Motion.from_speeds(motion.period, motion.q[0], motion.v[:samples])
        tables = {name: getattr(base, name)[:, :samples] for name in TABLES}
        variants = random_variants(dataclasses.replace(base, motion=cut, **tables), 300)
        simulate_axes(variants)
        tracemalloc.start()
        simulate_axes(variants)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    one_signal = 300 * base.motion.n * 8 * (400 - 20)
    assert peak(400) - peak(20) < 0.1 * one_signal


@pytest.mark.parametrize("omega", [0.0, 1e-3, 0.0099, 0.0101, 6.0, 300.0])
@pytest.mark.parametrize("d", [1e-7, 0.005])
def test_sine_integrals(omega, d):
    t, weights = np.polynomial.legendre.leggauss(20)
    t = d * (t + 1) / 2
    expected = [np.sum(f * np.exp(1j * omega * t) * weights) * d / 2 for f in (1, d - t)]
    actual = _sine_integrals(np.array([omega]), d, np.exp(1j * np.array([omega]) * d))

    for have, want, power in zip(actual, expected, (1, 2), strict=True):
        np.testing.assert_allclose(have, want, rtol=0, atol=1e-8 * d**power + 1e-12 * 0.005**power)


def test_tables_are_shared(make):
    designs = [
        make(set_to(feedforward_gain=[gain, 1.0, 1.0, 1.0], amplitude=gain))
        for gain in (0.5, 0.0, 1.5)
    ]
    variants = variants_of([*designs, make()])

    assert variants.load_torque.shape == variants.feedforward.shape == (1, 501, 4)
    np.testing.assert_array_equal(variants.feedforward_gain[:, 0], [0.5, 0.0, 1.5, 1.0])


FRICTION = Friction(coulomb=[1.0] * 4, viscous=[1.0] * 4)


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("controller.kind: p_pi", set_to(kind="p_pi")),
        ("controller.kind: pi_scheduled", set_to(kind="pi_scheduled")),
        ("controller.anti_windup", set_to(anti_windup=True)),
        ("drive", set_to(drive=Drive())),
        ("plant.friction", set_to(friction=FRICTION)),
        ("plant.elasticity", set_to(elasticity=Elasticity(natural_frequency=[100.0] * 4))),
        ("plant.kind: coupled", lambda scenario: setattr(scenario.plant, "kind", "coupled")),
    ],
)
def test_refuses_what_only_drake_runs(short, field, change):
    scenario = copy.deepcopy(short.scenario)
    change(scenario)
    with pytest.raises(InputError, match=f"{field} runs in Drake only"):
        variants_of([short, dataclasses.replace(short, scenario=scenario)])


def test_refuses_other_motions_and_nothing(short):
    slower = dataclasses.replace(short.motion, v=0.5 * short.motion.v)
    with pytest.raises(InputError, match="another motion or period"):
        variants_of([short, dataclasses.replace(short, motion=slower)])
    with pytest.raises(InputError, match="none, expected at least one"):
        variants_of([])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"i_eff": np.zeros((3, 4))}, "i_eff: 0, every value must be > 0"),
        ({"kp": np.ones((3, 2))}, r"kp: shape \(3, 2\), expected \(3, 4\)"),
        ({"amplitude": np.array([0, np.nan, 0])}, "amplitude: contains a value that is not finite"),
        ({"omega_d": np.array([0.0, -1.0, 0.0])}, "omega_d: -1, every value must be >= 0"),
        ({"load_of": np.array([0, 7, 0])}, "load_of: 7, but load_torque has"),
    ],
)
def test_refuses_bad_arrays(base, change, message):
    with pytest.raises(InputError, match=message):
        dataclasses.replace(base, **change)


def test_same_motion_made_twice_is_one_motion(short):
    torques = torque_groups(short.robot, short.motion.q, short.motion.v, short.motion.vd)
    again = dataclasses.replace(
        short, torques=torques, motion=dataclasses.replace(short.motion, v=short.motion.v.copy())
    )
    assert len(variants_of([short, again])) == 2
