"""Every block alone, without a simulator: outputs, derivatives, samples; ports; bad input."""

import re
import textwrap

import numpy as np
import pytest
from alone import (
    ARGUMENTS,
    ENVELOPE,
    GAINS,
    GEAR,
    LOADS,
    MOTION,
    PERIOD,
    ROTORS,
    Alone,
    N,
    arguments_of,
    close,
    exact,
    inputs_of,
    outputs_of,
)
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.common.yaml import yaml_load
from pydrake.systems.framework import DiagramBuilder

import sdt_drake.systems as systems
from sdt_drake.control import SpeedGains
from sdt_drake.deviation import Deviation, deviated
from sdt_drake.device import Springs
from sdt_drake.errors import InputError
from sdt_drake.systems import (
    Envelope,
    ReferenceTorque,
    axis_process_block,
    constant_block,
    ctc_feedforward_block,
    disturbance_block,
    dynamic_saturation_block,
    elastic_joints_block,
    encoder_block,
    feedforward_torque_block,
    friction_block,
    gain_schedule_block,
    inverse_dynamics_block,
    load_torque_block,
    make_block,
    pi_speed_controller_block,
    place_flat,
    position_loop_block,
    reference_source_block,
    robot_plant_block,
    table_block,
    torque_loop_block,
    true_load_block,
    zero_order_hold_block,
)

RNG = np.random.default_rng(4)


# --- controller ------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [False, True], ids=["one system", "elements"])
@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_pi_law_and_its_integral(structure, elements):
    block = Alone(pi_speed_controller_block, structure=structure, elements=elements)
    for _ in range(3):
        q_ref, v_ref, vd_ref, q, v, integral = RNG.normal(size=(6, N))
        block.give(reference=[*q_ref, *v_ref, *vd_ref], state=[*q, *v])
        block.context.SetContinuousState(integral)
        fed_back = {"pi": v - v_ref, "p_in_feedback": v}[structure]
        close(block.output("tau_fb"), GAINS.ki * integral - GAINS.kp * GEAR * fed_back)
        close(block.derivatives(), GEAR * (v_ref - v))


def test_pi_has_p_in_feedback_by_default():
    block = Alone(pi_speed_controller_block)
    block.give(reference=np.ones(3 * N), state=np.zeros(2 * N))
    exact(block.output("tau_fb"), np.zeros(N))


SAMPLED = pytest.mark.parametrize("period", [None, PERIOD / 4], ids=["continuous", "sampled"])
ELEMENTS = pytest.mark.parametrize("elements", [False, True], ids=["one system", "elements"])


@SAMPLED
@ELEMENTS
@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_pi_with_anti_windup_passes_no_torque_on(structure, elements, period):
    """Or tau_fb would follow from itself."""
    block = Alone(
        pi_speed_controller_block,
        structure=structure,
        anti_windup=True,
        period=period,
        elements=elements,
    )
    assert inputs_of(block.diagram).keys() == {"reference", "state", "tau_cmd", "tau"}
    assert not block.passes("tau", "tau_fb")
    assert not block.passes("tau_cmd", "tau_fb")
    assert block.passes("state", "tau_fb")


@SAMPLED
@ELEMENTS
@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_anti_windup_does_nothing_while_the_motor_gives_what_it_should(structure, elements, period):
    changes = {"structure": structure, "period": period, "elements": elements}
    plain = Alone(pi_speed_controller_block, **changes)
    block = Alone(pi_speed_controller_block, anti_windup=True, **changes)
    reference, state = RNG.normal(size=3 * N), RNG.normal(size=2 * N)
    tau = 100 * RNG.normal(size=N)
    plain.give(reference=reference, state=state)
    block.give(reference=reference, state=state, tau_cmd=tau, tau=tau)
    for _ in range(3):
        close(block.output("tau_fb"), plain.output("tau_fb"))
        for each in (plain, block):
            if period is None:
                each.context.SetContinuousState(each.derivatives())
            else:
                each.sample()


@ELEMENTS
def test_sampled_pi_adds_period_times_error_at_each_sample(elements):
    block = Alone(pi_speed_controller_block, period=PERIOD, anti_windup=True, elements=elements)
    assert block.timing == (0, PERIOD)
    v_ref, v, tau_cmd, tau = RNG.normal(size=(4, N))
    block.give(
        reference=[*np.zeros(N), *v_ref, *np.zeros(N)],
        state=[*np.zeros(N), *v],
        tau_cmd=tau_cmd,
        tau=tau,
    )
    rate = GEAR * (v_ref - v) + (tau - tau_cmd) / GAINS.kp
    for k in range(4):
        close(block.output("tau_fb"), GAINS.ki * k * PERIOD * rate - GAINS.kp * GEAR * v)
        block.context.SetTime((k + 0.9) * PERIOD)  # held between samples
        close(block.output("tau_fb"), GAINS.ki * k * PERIOD * rate - GAINS.kp * GEAR * v)
        block.sample()


@pytest.mark.parametrize(
    ("describe", "inputs", "output"),
    [
        (ctc_feedforward_block, ("tau_fb", "tau_ff"), "tau_cmd"),
        (true_load_block, ("modelled_load", "disturbance"), "load_torque"),
    ],
)
def test_sums(describe, inputs, output):
    block = Alone(describe)
    first, second = RNG.normal(size=(2, N))
    block.give(**{inputs[0]: first, inputs[1]: second})
    exact(block.output(output), first + second)


def test_true_load_has_the_parts_it_is_given():
    block = Alone(true_load_block, parts=["disturbance", "friction", "more"])
    assert list(inputs_of(block.diagram)) == ["disturbance", "friction", "more"]
    parts = RNG.normal(size=(3, N))
    block.give(disturbance=parts[0], friction=parts[1], more=parts[2])
    close(block.output("load_torque"), parts.sum(axis=0))


@pytest.mark.parametrize(
    ("tau_cmd", "alleviating", "tau"),
    [
        (50, 0, 50),  # plain saturation
        (100, 0, 100),
        (150, 0, 100),
        (-100, 0, -100),
        (-150, 0, -100),
        (150, 30, 130),  # help upwards widens the upper limit, and only that
        (120, 30, 120),
        (-150, 30, -100),
        (-150, -30, -130),  # help downwards the lower one
        (-120, -30, -120),
        (150, -30, 100),
        (500, 300, 400),  # more than the motor itself
        (-500, -300, -400),
    ],
)
def test_saturation_widens_in_the_direction_of_the_help(tau_cmd, alleviating, tau):
    block = Alone(dynamic_saturation_block)
    others = [1.0, -2.0]  # each joint on its own
    for k in range(N):
        block.give(
            tau_cmd=np.insert(others, k, tau_cmd),
            alleviating_torque=np.insert([0.0, 0.0], k, alleviating),
        )
        exact(block.output("tau"), np.insert(others, k, tau))


def test_saturation_of_each_motor_by_its_own_limit_and_exact_within():
    limit = np.array([203.2, 3950.0, 0.3])
    block = Alone(dynamic_saturation_block, motor_torque_limit=limit)
    for share in RNG.uniform(-1, 1, size=(50, N)):
        block.give(tau_cmd=limit * share, alleviating_torque=RNG.normal(size=N))
        exact(block.output("tau"), limit * share)
    block.give(tau_cmd=[1e9] * N, alleviating_torque=np.zeros(N))
    exact(block.output("tau"), limit)


@pytest.mark.parametrize("alleviating", [0.0, 30.0, -30.0])
@pytest.mark.parametrize("tau_cmd", [50.0, 150.0, -150.0])
def test_saturation_can_be_differentiated(tau_cmd, alleviating):
    """By AutoDiff, saturated or not, also where no help widens the limits (a = 0)."""
    diagram = Alone(dynamic_saturation_block, motor_torque_limit=[100.0]).diagram.ToAutoDiffXd()
    context = diagram.CreateDefaultContext()
    inputs = InitializeAutoDiff([tau_cmd, alleviating])
    diagram.GetInputPort("tau_cmd").FixValue(context, inputs[0])
    diagram.GetInputPort("alleviating_torque").FixValue(context, inputs[1])
    tau = diagram.GetOutputPort("tau").Eval(context)[0]
    if abs(tau_cmd) == 50:
        value, gradient = tau_cmd, [1, 0]
    else:
        widened = tau_cmd * alleviating > 0
        value, gradient = np.sign(tau_cmd) * (130 if widened else 100), [0, widened]
    assert tau.value() == value
    exact(tau.derivatives(), gradient)


@pytest.mark.parametrize("alleviating", [0.0, 30.0, -30.0])
@pytest.mark.parametrize("way", [1, -1], ids=["forwards", "backwards"])
@pytest.mark.parametrize(
    ("motor_speed", "left"),
    [(0, 1), (25, 1), (50, 1), (75, 0.75), (100, 0.5), (149, 0.01), (150, 0), (151, 0), (1e4, 0)],
)
def test_envelope_takes_torque_away_in_the_direction_of_the_motion(
    motor_speed, left, way, alleviating
):
    """Full torque up to n1 = 50, half of it in the middle, none beyond n0 = 150 rad/s."""
    envelope = Envelope(np.full(N, 50.0), np.full(N, 150.0), GEAR)
    block = Alone(dynamic_saturation_block, envelope=envelope)
    v = way * motor_speed / GEAR
    block.give(state=[*RNG.normal(size=N), *v], alleviating_torque=np.full(N, alleviating))
    widened = abs(alleviating) * (way * alleviating > 0), abs(alleviating) * (way * alleviating < 0)
    block.give(tau_cmd=np.full(N, way * 1e6))
    close(block.output("tau"), np.full(N, way * (100 * left + widened[0])))
    block.give(tau_cmd=np.full(N, -way * 1e6))  # braking
    close(block.output("tau"), np.full(N, -way * (100 + widened[1])))


def test_envelope_of_each_motor_at_its_own_speed():
    limit = np.array([100.0, 200.0, 300.0])
    block = Alone(dynamic_saturation_block, envelope=ENVELOPE, motor_torque_limit=limit)
    block.give(tau_cmd=[1e6] * N, alleviating_torque=np.zeros(N))
    for share in RNG.uniform(0, 1, size=(20, N)):
        motor_speed = ENVELOPE.n0 - share * (ENVELOPE.n0 - ENVELOPE.n1)
        block.give(state=[*np.zeros(N), *(motor_speed / GEAR)])
        close(block.output("tau"), share * limit)


def test_saturation_sees_the_speed_only_with_an_envelope():
    assert list(inputs_of(Alone(dynamic_saturation_block).diagram)) == [
        "tau_cmd",
        "alleviating_torque",
    ]
    block = Alone(dynamic_saturation_block, envelope=ENVELOPE)
    assert list(inputs_of(block.diagram)) == ["tau_cmd", "alleviating_torque", "state"]
    assert block.passes("state", "tau")


@pytest.mark.parametrize("time", [0.0, 0.1, 0.25, 1.7, 29.995])
def test_disturbance_is_a_share_of_the_load_at_every_time(time):
    block = Alone(disturbance_block)
    load = np.array([10.0, -200.0, 0.0])
    block.give(load_torque=load)
    block.output("disturbance")  # at time 0: the next must follow time
    block.context.SetTime(time)
    close(block.output("disturbance"), 0.05 * np.sin(7.0 * time) * load)


@pytest.mark.parametrize(
    ("describe", "changes"),
    [
        (dynamic_saturation_block, {}),
        (dynamic_saturation_block, {"envelope": ENVELOPE}),
        (disturbance_block, {}),
        (gain_schedule_block, {}),
        (encoder_block, {"resolution": [50.0] * N, "gear_ratio": GEAR}),
    ],
)
def test_static_laws_stand_still(describe, changes):
    block = Alone(describe, **changes)
    for name, port in inputs_of(block.diagram).items():
        block.give(**{name: np.full(port.size(), 1e3)})
    assert not block.derivatives().any()


# --- other feedbacks -------------------------------------------------------------------------


def test_position_loop_asks_for_speed_against_the_position_error():
    block = Alone(position_loop_block)
    q_ref, v_ref, vd_ref, q, v = RNG.normal(size=(5, N))
    block.give(reference=[*q_ref, *v_ref, *vd_ref], state=[*q, *v])
    asked = block.output("reference")
    exact(asked[:N], q_ref)
    exact(asked[2 * N :], vd_ref)
    close(asked[N : 2 * N], v_ref + [2, 3, 5] * (q_ref - q))
    block.give(state=[*q_ref, *(1e9 * v)])  # on the reference; the speed is not its business
    close(block.output("reference"), [*q_ref, *v_ref, *vd_ref])


def test_schedule_weights_speeds_alone():
    block = Alone(gain_schedule_block)
    reference, state, share = RNG.normal(size=3 * N), RNG.normal(size=2 * N), [1.0, 0.5, 0.0]
    block.give(reference=reference, state=state, inertia_share=share)
    exact(block.output("reference"), reference * [1, 1, 1, *share, 1, 1, 1])
    exact(block.output("state"), state * [1, 1, 1, *share])


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_behind_a_schedule_pi_has_gains_in_proportion(structure):
    share = np.array([0.2, 0.5, 0.9])
    schedule = Alone(gain_schedule_block)
    pi = Alone(pi_speed_controller_block, structure=structure)
    scaled = SpeedGains(share * GAINS.kp, share * GAINS.ki)
    expected = Alone(pi_speed_controller_block, structure=structure, gains=scaled)
    reference, state, integral = RNG.normal(size=3 * N), RNG.normal(size=2 * N), RNG.normal(size=N)
    schedule.give(reference=reference, state=state, inertia_share=share)
    pi.give(**{name: schedule.output(name) for name in ("reference", "state")})
    expected.give(reference=reference, state=state)
    pi.context.SetContinuousState(share * integral)  # the weight is inside the integral
    expected.context.SetContinuousState(integral)
    close(pi.output("tau_fb"), expected.output("tau_fb"))
    close(pi.derivatives(), share * expected.derivatives())


def test_schedule_does_not_change_what_the_integral_gives():
    """Where the speed is zero, or with both gains on the error also where there is none."""
    for structure, speed in (("p_in_feedback", 0.0), ("pi", 0.0), ("pi", 0.7)):
        schedule = Alone(gain_schedule_block)
        pi = Alone(pi_speed_controller_block, structure=structure)
        pi.context.SetContinuousState([1.0, 2.0, 3.0])
        schedule.give(reference=np.full(3 * N, speed), state=np.full(2 * N, speed))
        for share in (1.0, 0.3):
            schedule.give(inertia_share=np.full(N, share))
            pi.give(**{name: schedule.output(name) for name in ("reference", "state")})
            close(pi.output("tau_fb"), GAINS.ki * [1, 2, 3])


def computed_torque(model, reference, state):
    """r tau_fb = M(q) (wanted acceleration) + bias(q, v) - gravity(q), by the plant of `model`."""
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    q, v = np.split(state, 2)
    arguments = ARGUMENTS[inverse_dynamics_block]
    omega_n, zeta = np.array(arguments["omega_n"]), np.array(arguments["zeta"])
    wanted = vd_ref + 2 * zeta * omega_n * (v_ref - v) + omega_n**2 * (q_ref - q)
    context = model.plant.CreateDefaultContext()
    model.plant.SetPositionsAndVelocities(context, state)
    bias = model.plant.CalcBiasTerm(context) - model.plant.CalcGravityGeneralizedForces(context)
    return (model.plant.CalcMassMatrix(context) @ wanted + bias) / model.gear_ratio, wanted


def test_inverse_dynamics_is_computed_torque(robot):
    block = Alone(inverse_dynamics_block, robot)
    for _ in range(10):
        reference, state = RNG.normal(size=12), RNG.normal(size=8)
        block.give(reference=reference, state=state)
        expected, _ = computed_torque(robot, reference, state)
        np.testing.assert_allclose(block.output("tau_fb"), expected, rtol=1e-9, atol=1e-6)


def test_inverse_dynamics_makes_every_joint_a_double_integrator(robot):
    block, plant = Alone(inverse_dynamics_block, robot), Alone(robot_plant_block, robot)
    reference, state = RNG.normal(size=12), RNG.normal(size=8)
    block.give(reference=reference, state=state)
    plant.give(tau=block.output("tau_fb"), load_torque=np.zeros(4))
    plant.context.SetContinuousState(state)
    _, wanted = computed_torque(robot, reference, state)
    np.testing.assert_allclose(plant.derivatives()[4:], wanted, rtol=1e-8)


def test_inverse_dynamics_goes_by_its_model(robot):
    model = deviated(robot, Deviation(payload_mass=100.0, inertia_scale=1.1))
    block = Alone(inverse_dynamics_block, model)
    reference, state = RNG.normal(size=12), RNG.normal(size=8)
    block.give(reference=reference, state=state)
    expected, _ = computed_torque(model, reference, state)
    right, _ = computed_torque(robot, reference, state)
    np.testing.assert_allclose(block.output("tau_fb"), expected, rtol=1e-9, atol=1e-6)
    assert np.all(np.abs(expected - right) > 0.01 * np.abs(right))


def test_inverse_dynamics_has_no_integral(robot):
    block = Alone(inverse_dynamics_block, robot)
    block.give(reference=RNG.normal(size=12), state=RNG.normal(size=8))
    before = block.output("tau_fb").copy()
    states = block.context.num_continuous_states()  # of Drake's PID controller, with gain 0
    block.context.SetContinuousState(np.full(states, 1e3))
    exact(block.output("tau_fb"), before)


# --- process ---------------------------------------------------------------------------------


def test_axis_process_is_eq_1():
    i_eff = np.array(ARGUMENTS[axis_process_block]["i_eff"])
    block = Alone(axis_process_block)
    q, v, tau, load = RNG.normal(size=(4, N))
    block.give(tau=tau, load_torque=load)
    block.context.SetContinuousState([*q, *v])
    exact(block.output("state"), [*q, *v])
    close(block.derivatives(), [*v, *((tau - load) / i_eff / GEAR)])


SOME = np.array([True, False, True, False])


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("without_rotor", [None, ~SOME, SOME, SOME | True, SOME & False])
def test_robot_plant_moves_by_its_mass_matrix_and_clamps_nothing(robot, loaded, without_rotor):
    """M vd = r (tau - load_torque) - C + gravity; torques up to ten times the motors' limits.

    M is without the rotors that turn apart from their joints.
    """
    block = Alone(robot_plant_block, robot, loaded=loaded, without_rotor=without_rotor)
    assert list(inputs_of(block.diagram)) == (["tau", "load_torque"] if loaded else ["tau"])
    context = robot.plant.CreateDefaultContext()
    r, rotor = np.array([67.2, 1, 1, 1]), np.array([0.1291, 1.73, 0.531, 0.531])  # as published
    apart = np.zeros(4) if without_rotor is None else r**2 * rotor * without_rotor
    for share in (0.1, 1, 10):
        q, v, tau, load = RNG.normal(size=(4, robot.n))
        tau = np.copysign(share * robot.motor_torque_limit, tau)
        block.give(tau=tau)
        if loaded:
            block.give(load_torque=100 * load)
            tau = tau - 100 * load
        block.context.SetContinuousState([*q, *v])
        exact(block.output("state"), [*q, *v])
        robot.plant.SetPositionsAndVelocities(context, [*q, *v])
        rest = robot.plant.CalcGravityGeneralizedForces(context) - robot.plant.CalcBiasTerm(context)
        M = robot.plant.CalcMassMatrix(context) - np.diag(apart)
        vd = np.linalg.solve(M, r * tau + rest)
        np.testing.assert_allclose(block.derivatives(), [*v, *vd], rtol=1e-9)


# --- references ------------------------------------------------------------------------------


def test_reference_source_is_exact_at_every_sample():
    block = Alone(reference_source_block)
    rows = np.hstack([MOTION.q, MOTION.v, MOTION.vd])
    for i, row in enumerate(rows):
        block.context.SetTime(i * PERIOD)
        # The very last one is the end of a segment, with its round-off.
        (exact if i < len(rows) - 1 else close)(block.output("reference"), row)


def test_reference_source_is_linear_between_samples():
    block = Alone(reference_source_block)
    rows = np.hstack([MOTION.q, MOTION.v, MOTION.vd])
    for i, share in [(0, 0.5), (7, 0.25), (2999, 0.9)]:
        block.context.SetTime((i + share) * PERIOD)
        expected = (1 - share) * rows[i] + share * rows[i + 1]
        np.testing.assert_allclose(block.output("reference"), expected, rtol=0, atol=1e-8)


def test_constant_is_constant():
    block = Alone(constant_block, signal="load_torque")
    exact(block.output("load_torque"), [1.0, -2.0])
    block.context.SetTime(3.0)
    exact(block.output("load_torque"), [1.0, -2.0])


def test_hold_holds():
    block = Alone(zero_order_hold_block)
    timing = block.diagram.GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.offset_sec(), timing.period_sec()) == (0, PERIOD)
    assert not block.diagram.HasAnyDirectFeedthrough()
    first, second = RNG.normal(size=(2, 3 * N))
    block.give(reference=first)
    exact(block.output("reference"), np.zeros(3 * N))  # nothing sampled yet
    block.sample()
    block.give(reference=second)
    block.context.SetTime(0.9 * PERIOD)
    exact(block.output("reference"), first)
    block.sample()
    exact(block.output("reference"), second)


SIGNALS = {**LOADS._asdict(), "inertia_share": MOTION.v}


def test_table_is_in_force_from_its_sample_on():
    block = Alone(table_block, signals=SIGNALS)
    assert list(outputs_of(block.diagram)) == list(SIGNALS)
    assert block.timing == (0, PERIOD)
    for i in range(len(MOTION.q) - 1):
        block.sample(time=i * PERIOD)
        for name, samples in SIGNALS.items():
            exact(block.output(name), samples[i])
        if i % 500 == 0:
            block.context.SetTime((i + 0.99) * PERIOD)
            exact(block.output("load_torque"), LOADS.load_torque[i])


# Offsets of the samples are what is left of the delay beyond whole periods.
DELAYS = pytest.mark.parametrize(
    ("delay", "offset"),
    [
        (0.0, 0.0),
        (PERIOD, 0.0),
        (3 * PERIOD, 0.0),
        (0.035, 0.0),  # 7 periods, but for the last bit
        (0.3 * PERIOD, 0.3 * PERIOD),
        (0.0085, 0.0035),
        (0.0499, 0.0049),
    ],
)
WHICH = [0, 1, 2, 3, 10, 100, 1234, 2998]


def is_in_force(block, name, rows, delay, offset):
    """Row k from k * period + delay on, and not before; before row 0 arrives, row 0."""
    assert block.timing == pytest.approx((offset, PERIOD), rel=1e-12, abs=0)
    late = round((delay - offset) / PERIOD)  # samples taken before row 0 arrives
    for i in range(late):
        block.sample(time=offset + i * PERIOD)
        np.testing.assert_allclose(block.output(name), rows[0], rtol=0, atol=1e-9)
    for k in WHICH:
        instant = offset + (k + late) * PERIOD  # as Drake counts
        assert instant == pytest.approx(k * PERIOD + delay, rel=1e-12)
        block.sample(time=instant)
        np.testing.assert_allclose(block.output(name), rows[k], rtol=0, atol=1e-9)
        block.context.SetTime(instant + 0.99 * PERIOD)
        np.testing.assert_allclose(block.output(name), rows[k], rtol=0, atol=1e-9)


@DELAYS
def test_delayed_table_is_in_force_from_its_arrival_on(delay, offset):
    block = Alone(table_block, signals=SIGNALS, delay=delay)
    is_in_force(block, "alleviating_torque", LOADS.alleviating_torque, delay, offset)


@DELAYS
def test_delayed_source_rests_on_its_first_sample_until_it_arrives(delay, offset):
    rows = np.hstack([MOTION.q, MOTION.v, MOTION.vd])
    source = Alone(reference_source_block, delay=delay)
    for share in (0.0, 0.5, 1.0):
        source.context.SetTime(share * delay)
        np.testing.assert_allclose(source.output("reference"), rows[0], rtol=0, atol=1e-9)
    for k in WHICH:
        source.context.SetTime(k * PERIOD + delay)
        np.testing.assert_allclose(source.output("reference"), rows[k], rtol=0, atol=1e-9)


@DELAYS
def test_hold_samples_a_delayed_source_where_its_samples_arrive(delay, offset):
    builder = DiagramBuilder()
    source = place_flat(builder, "source", reference_source_block, motion=MOTION, delay=delay)
    hold = place_flat(
        builder, "hold", zero_order_hold_block, size=3 * N, period=PERIOD, delay=delay
    )
    builder.Connect(source.outputs["reference"], hold.inputs["reference"])
    builder.ExportOutput(hold.outputs["reference"], "reference")
    rows = np.hstack([MOTION.q, MOTION.v, MOTION.vd])
    is_in_force(Alone.of(builder.Build()), "reference", rows, delay, offset)


# --- ports and pictures ----------------------------------------------------------------------

BLOCKS = [name for name in systems.__all__ if name.endswith("_block") and name != "make_block"]
# The name of a block is that of its function, but for the one that wraps Drake's own system.
NAMES = {name: name.removesuffix("_block") for name in BLOCKS} | {
    "robot_plant_block": "multibody_plant"
}


def picture(documented):
    """The YAML under `.. pydrake_system::` in a docstring."""
    text = re.search(
        r"^ *\.\. pydrake_system::\n((?:\n| {8}.*\n)+)", f"{documented.__doc__}\n", re.MULTILINE
    )
    assert text, f"no picture of {documented.__name__}"
    return yaml_load(data=textwrap.dedent(text[1]))


def holds_to_its_picture(documented, system, name):
    drawn = picture(documented)
    assert drawn["name"] == name
    assert drawn.get("input_ports", []) == list(inputs_of(system))
    assert drawn.get("output_ports", []) == list(outputs_of(system))
    assert drawn.keys() <= {"name", "input_ports", "output_ports"}


def test_all_blocks_are_tested_here():
    assert {getattr(systems, name) for name in BLOCKS} == ARGUMENTS.keys()


@pytest.mark.parametrize("name", BLOCKS)
def test_picture_in_the_docstring_has_the_real_ports(name, robot):
    describe = getattr(systems, name)
    diagram = make_block(NAMES[name], describe, **arguments_of(describe, robot))
    assert diagram.get_name() == NAMES[name]
    holds_to_its_picture(describe, diagram, NAMES[name])


def test_picture_of_reference_torque(robot):
    system = ReferenceTorque(robot=robot, outputs=["(outputs)"], law=lambda *_: [np.zeros(4)])
    holds_to_its_picture(ReferenceTorque, system, "ReferenceTorque")


@pytest.mark.parametrize(
    ("describe", "changes", "expected"),
    [
        (axis_process_block, {}, {}),
        (
            elastic_joints_block,
            {},
            {("tau", "tau_link"), ("state", "tau_link"), ("state", "motor_state")},
        ),
        (encoder_block, {}, {}),
        (encoder_block, {"resolution": [50.0] * N, "gear_ratio": GEAR}, {}),
        (friction_block, {}, {("state", "friction")}),
        (inverse_dynamics_block, {}, {("reference", "tau_fb"), ("state", "tau_fb")}),
        (position_loop_block, {}, {("reference", "reference"), ("state", "reference")}),
        (robot_plant_block, {}, {}),
        (torque_loop_block, {}, {("tau_limited", "tau")}),
        (torque_loop_block, {"bandwidth": 300.0}, {}),
        (zero_order_hold_block, {}, {}),
    ],
)
def test_what_acts_at_once(describe, changes, expected, robot):
    """What is not listed leaves no algebraic loop."""
    block = Alone(describe, robot, **changes)
    ways = [(i, o) for i in inputs_of(block.diagram) for o in outputs_of(block.diagram)]
    assert {way for way in ways if block.passes(*way)} == set(expected)


# --- bad input -------------------------------------------------------------------------------

RESOLVED = {"resolution": [50.0] * N, "gear_ratio": GEAR}
RIGID = Springs(np.full(N, False), np.zeros(N), np.zeros(N))


@pytest.mark.parametrize(
    ("describe", "bad"),
    [
        (pi_speed_controller_block, {"structure": "pid"}),
        (pi_speed_controller_block, {"gear_ratio": GEAR[:2]}),
        (pi_speed_controller_block, {"gear_ratio": [1.0, 0.0, 1.0]}),
        (pi_speed_controller_block, {"gains": SpeedGains(GAINS.kp, GAINS.ki[:2])}),
        (pi_speed_controller_block, {"gains": SpeedGains(-GAINS.kp, GAINS.ki)}),
        (pi_speed_controller_block, {"gains": SpeedGains(GAINS.kp, 0 * GAINS.ki)}),
        (pi_speed_controller_block, {"gains": SpeedGains(GAINS.kp, np.nan * GAINS.ki)}),
        (ctc_feedforward_block, {"n": 0}),
        (dynamic_saturation_block, {"motor_torque_limit": [1.0, 0.0, 1.0]}),
        (dynamic_saturation_block, {"motor_torque_limit": [1.0, -1.0, 1.0]}),
        (dynamic_saturation_block, {"motor_torque_limit": [1.0, np.inf, 1.0]}),
        (dynamic_saturation_block, {"motor_torque_limit": [1.0, np.nan, 1.0]}),
        (dynamic_saturation_block, {"motor_torque_limit": []}),
        (disturbance_block, {"amplitude": -0.05}),
        (disturbance_block, {"amplitude": np.nan}),
        (disturbance_block, {"omega_d": -1.0}),
        (disturbance_block, {"omega_d": np.inf}),
        (disturbance_block, {"n": 0}),
        (true_load_block, {"n": 0}),
        (axis_process_block, {"i_eff": [2.0, 0.0, 9.0]}),
        (axis_process_block, {"i_eff": [2.0, 5.0]}),
        (axis_process_block, {"gear_ratio": [1.0, np.nan, 1.0]}),
        (axis_process_block, {"gear_ratio": -GEAR}),
        (zero_order_hold_block, {"period": 0.0}),
        (zero_order_hold_block, {"period": -PERIOD}),
        (zero_order_hold_block, {"period": np.nan}),
        (zero_order_hold_block, {"size": 0}),
        (zero_order_hold_block, {"delay": -PERIOD / 2}),
        (table_block, {"signals": {"v": MOTION.v[:-1]}}),
        (table_block, {"signals": {"v": MOTION.v[:, :-1]}}),
        (table_block, {"signals": {"good": MOTION.v, "v": MOTION.v[:, 0]}}),
        (table_block, {"delay": -PERIOD}),
        (table_block, {"delay": np.nan}),
        (table_block, {"delay": np.inf}),
        (reference_source_block, {"delay": -PERIOD}),
        (reference_source_block, {"delay": np.nan}),
        (reference_source_block, {"delay": np.inf}),
        (load_torque_block, {"sign": "other"}),
        (feedforward_torque_block, {"sign": "other"}),
        (feedforward_torque_block, {"feedforward": "pid"}),
        (pi_speed_controller_block, {"period": 0.0}),
        (pi_speed_controller_block, {"period": -PERIOD}),
        (pi_speed_controller_block, {"period": np.nan}),
        (dynamic_saturation_block, {"envelope": Envelope(ENVELOPE.n0, ENVELOPE.n1, GEAR)}),
        (dynamic_saturation_block, {"envelope": Envelope(ENVELOPE.n0, ENVELOPE.n0, GEAR)}),
        (elastic_joints_block, {"rotor_inertia": [0.1, 1.0, 0.0]}),
        (elastic_joints_block, {"rotor_inertia": [-0.1, 1.0, 1.0]}),
        (elastic_joints_block, {"rotor_inertia": [0.1, 1.0, np.nan]}),
        (elastic_joints_block, {"rotor_inertia": ROTORS[:2]}),
        (elastic_joints_block, {"gear_ratio": GEAR[:2]}),
        (elastic_joints_block, {"gear_ratio": -GEAR}),
        (elastic_joints_block, {"springs": RIGID}),
        (encoder_block, {"n": 0}),
        (encoder_block, {"period": 0.0}),
        (encoder_block, {"period": np.inf}),
        (encoder_block, {"resolution": [50.0] * N}),  # of the motor, so with its gear
        (encoder_block, {**RESOLVED, "resolution": [50.0, 0.0, 50.0]}),
        (encoder_block, {**RESOLVED, "resolution": [50.0, -1.0, 50.0]}),
        (encoder_block, {**RESOLVED, "resolution": [50.0]}),
        (encoder_block, {**RESOLVED, "gear_ratio": -GEAR}),
        (encoder_block, {**RESOLVED, "gear_ratio": GEAR[:2]}),
        (friction_block, {"gear_ratio": GEAR[:2]}),
        (friction_block, {"gear_ratio": [1.0, 0.0, 1.0]}),
        (gain_schedule_block, {"n": 0}),
        (inverse_dynamics_block, {"omega_n": [1.0, 1.0, 1.0, 0.0]}),
        (inverse_dynamics_block, {"omega_n": [1.0, 1.0, 1.0]}),
        (inverse_dynamics_block, {"omega_n": [1.0, 1.0, 1.0, np.inf]}),
        (inverse_dynamics_block, {"zeta": [1.0, -1.0, 1.0, 1.0]}),
        (inverse_dynamics_block, {"zeta": 1.0}),
        (position_loop_block, {"position_gain": [1.0, 0.0, 1.0]}),
        (position_loop_block, {"position_gain": [1.0, np.nan, 1.0]}),
        (position_loop_block, {"position_gain": []}),
        (torque_loop_block, {"motor_torque_limit": [1.0, 0.0, 1.0]}),
        (torque_loop_block, {"motor_torque_limit": []}),
        (torque_loop_block, {"bandwidth": 0.0}),
        (torque_loop_block, {"bandwidth": -300.0}),
        (torque_loop_block, {"bandwidth": np.inf}),
        (torque_loop_block, {"error": [0.1, 0.1]}),
        (torque_loop_block, {"error": [0.1, np.nan, 0.1]}),
    ],
    ids=lambda value: value.__name__ if callable(value) else ", ".join(value),
)
def test_bad_input_is_refused(describe, bad, robot):
    with pytest.raises(InputError):
        make_block("bad", describe, **arguments_of(describe, robot, **bad))
