"""Every block alone, without a simulator: outputs, derivatives, samples; ports; bad input."""

import re
import textwrap

import numpy as np
import pytest
from pydrake.autodiffutils import InitializeAutoDiff
from pydrake.common.yaml import yaml_load

import sdt_drake.systems as systems
from sdt_drake.control import SpeedGains
from sdt_drake.dynamics import Loads
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.systems import (
    LoadTorque,
    axis_process_block,
    constant_block,
    ctc_feedforward_block,
    disturbance_block,
    dynamic_saturation_block,
    load_torque_block,
    load_torque_table_block,
    make_block,
    pi_speed_controller_block,
    reference_source_block,
    robot_plant_block,
    true_load_block,
    zero_order_hold_block,
)

PERIOD = 0.005  # s
GEAR = np.array([67.2, 1.0, 3.5])
N = len(GEAR)
GAINS = SpeedGains(kp=np.array([3.0, 40.0, 500.0]), ki=np.array([20.0, 300.0, 4000.0]))
RNG = np.random.default_rng(4)
# Speeds that jump from sample to sample: any sample but the right one is far off.
MOTION = Motion.from_speeds(PERIOD, RNG.normal(size=N), RNG.normal(size=(3001, N)))
LOADS = Loads(RNG.normal(size=MOTION.q.shape), RNG.normal(size=MOTION.q.shape))

# What each block needs to be made; `robot` comes from the fixture.
ARGUMENTS = {
    axis_process_block: {"i_eff": [2.0, 5.0, 9.0], "gear_ratio": GEAR},
    constant_block: {"signal": "(signal)", "value": [1.0, -2.0]},
    ctc_feedforward_block: {"n": N},
    disturbance_block: {"n": N, "amplitude": 0.05, "omega_d": 7.0},
    dynamic_saturation_block: {"motor_torque_limit": [100.0] * N},
    load_torque_block: {"robot": None, "sign": "printed"},
    load_torque_table_block: {"motion": MOTION, "loads": LOADS},
    pi_speed_controller_block: {"gains": GAINS, "gear_ratio": GEAR},
    reference_source_block: {"motion": MOTION},
    robot_plant_block: {"robot": None},
    true_load_block: {"n": N},
    zero_order_hold_block: {"size": 3 * N, "period": PERIOD},
}


class Alone:
    """A block in a diagram of its own, with its context."""

    def __init__(self, describe, **changes):
        self.diagram = make_block("alone", describe, **{**ARGUMENTS[describe], **changes})
        self.context = self.diagram.CreateDefaultContext()

    def give(self, **inputs):
        """Fix input ports."""
        for name, value in inputs.items():
            port = self.diagram.GetInputPort(name)
            port.FixValue(self.context, np.asarray(value, dtype=float))

    def output(self, name):
        return self.diagram.GetOutputPort(name).Eval(self.context)

    def derivatives(self):
        return self.diagram.EvalTimeDerivatives(self.context).CopyToVector()

    def sample(self):
        """Let the periodic update happen."""
        update = self.diagram.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.SetDiscreteState(update)


def exact(actual, expected):
    np.testing.assert_array_equal(actual, expected)


def close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)


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


@pytest.mark.parametrize("time", [0.0, 0.1, 0.25, 1.7, 29.995])
def test_disturbance_is_a_share_of_the_load_at_every_time(time):
    block = Alone(disturbance_block)
    load = np.array([10.0, -200.0, 0.0])
    block.give(load_torque=load)
    block.output("disturbance")  # at time 0: the next must follow time
    block.context.SetTime(time)
    close(block.output("disturbance"), 0.05 * np.sin(7.0 * time) * load)


@pytest.mark.parametrize("describe", [dynamic_saturation_block, disturbance_block])
def test_static_laws_stand_still(describe):
    block = Alone(describe)
    for name, port in inputs_of(block.diagram).items():
        block.give(**{name: np.full(port.size(), 1e3)})
    assert not block.derivatives().any()


# --- process ---------------------------------------------------------------------------------


def test_axis_process_is_eq_1():
    i_eff = np.array(ARGUMENTS[axis_process_block]["i_eff"])
    block = Alone(axis_process_block)
    q, v, tau, load = RNG.normal(size=(4, N))
    block.give(tau=tau, load_torque=load)
    block.context.SetContinuousState([*q, *v])
    exact(block.output("state"), [*q, *v])
    close(block.derivatives(), [*v, *((tau - load) / i_eff / GEAR)])


@pytest.mark.parametrize("disturbed", [False, True])
def test_robot_plant_moves_by_its_mass_matrix_and_clamps_nothing(robot, disturbed):
    """M vd = r (tau - disturbance) - C + gravity; torques up to ten times the motors' limits."""
    block = Alone(robot_plant_block, robot=robot, disturbed=disturbed)
    context = robot.plant.CreateDefaultContext()
    for share in (0.1, 1, 10):
        q, v, tau, disturbance = RNG.normal(size=(4, robot.n))
        tau = np.copysign(share * robot.motor_torque_limit, tau)
        block.give(tau=tau)
        if disturbed:
            block.give(disturbance=100 * disturbance)
            tau = tau - 100 * disturbance
        block.context.SetContinuousState([*q, *v])
        exact(block.output("state"), [*q, *v])
        robot.plant.SetPositionsAndVelocities(context, [*q, *v])
        rest = robot.plant.CalcGravityGeneralizedForces(context) - robot.plant.CalcBiasTerm(context)
        vd = np.linalg.solve(
            robot.plant.CalcMassMatrix(context), [67.2, 1.0, 1.0, 1.0] * tau + rest
        )
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


def test_load_torque_table_is_in_force_from_its_sample_on():
    block = Alone(load_torque_table_block)
    timing = block.diagram.GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.offset_sec(), timing.period_sec()) == (0, PERIOD)
    for i in range(len(MOTION.q) - 1):
        block.context.SetTime(i * PERIOD)
        block.sample()
        exact(block.output("load_torque"), LOADS.load_torque[i])
        exact(block.output("alleviating_torque"), LOADS.alleviating_torque[i])
        if i % 500 == 0:
            block.context.SetTime((i + 0.99) * PERIOD)
            exact(block.output("load_torque"), LOADS.load_torque[i])


# --- ports and pictures ----------------------------------------------------------------------

BLOCKS = [name for name in systems.__all__ if name.endswith("_block") and name != "make_block"]
# The name of a block is that of its function, but for the one that wraps Drake's own system.
NAMES = {name: name.removesuffix("_block") for name in BLOCKS} | {
    "robot_plant_block": "multibody_plant"
}


def inputs_of(system):
    ports = map(system.get_input_port, range(system.num_input_ports()))
    return {port.get_name(): port for port in ports}


def outputs_of(system):
    ports = map(system.get_output_port, range(system.num_output_ports()))
    return {port.get_name(): port for port in ports}


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
    arguments = dict(ARGUMENTS[describe])
    if "robot" in arguments:
        arguments["robot"] = robot
    diagram = make_block(NAMES[name], describe, **arguments)
    assert diagram.get_name() == NAMES[name]
    holds_to_its_picture(describe, diagram, NAMES[name])


def test_picture_of_load_torque(robot):
    holds_to_its_picture(LoadTorque, LoadTorque(robot=robot), "LoadTorque")


# --- bad input -------------------------------------------------------------------------------


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
        (load_torque_table_block, {"loads": Loads(*(a[:-1] for a in LOADS))}),
        (load_torque_table_block, {"loads": Loads(*(a[:, :-1] for a in LOADS))}),
        (load_torque_block, {"sign": "other"}),
    ],
    ids=lambda value: value.__name__ if callable(value) else ", ".join(value),
)
def test_bad_input_is_refused(describe, bad, robot):
    arguments = {**ARGUMENTS[describe], **bad}
    if "robot" in arguments:
        arguments["robot"] = robot
    with pytest.raises(InputError):
        make_block("bad", describe, **arguments)
