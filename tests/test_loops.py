"""The loops: published results, independent integrations, and how they are wired."""

import copy
import dataclasses

import control
import numpy as np
import pytest
from pydrake.systems.framework import InputPortSelection, OutputPortSelection
from pydrake.systems.primitives import Linearize, VectorLogSink

from sdt_drake.control import SpeedGains, step_metrics, tune
from sdt_drake.design import make_design
from sdt_drake.dynamics import Loads
from sdt_drake.errors import InputError
from sdt_drake.loops import make_axis_loop, make_coupled_loop, make_loop, make_step_loop
from sdt_drake.motion import Motion
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import make_simulator, simulate
from sdt_drake.systems import read_logs

PUBLISHED = load_scenario("package://sdt/scenarios/axis_pi.yaml").controller
I_EFF_MAX = np.array([4.26, 98.01, 796.3, 250.28])
I_EFF_MIN = I_EFF_MAX * (1 - np.array([39.95, 31.82, 7.29, 25.4]) / 100)
STRUCTURES = ("pi", "p_in_feedback")
GEAR = np.array([67.2, 1, 1, 1])


@pytest.fixture(scope="module")
def variant(_reference_design):
    """A design from a shipped scenario with changed fields; robot and motion are shared."""

    def make(name, **changes):
        scenario = load_scenario(f"package://sdt/scenarios/{name}.yaml")
        for field, value in changes.items():
            *parents, field = field.split("__")
            target = scenario
            for parent in parents:
                target = getattr(target, parent)
            setattr(target, field, copy.deepcopy(value))
        return make_design(scenario, robot=_reference_design.robot, motion=_reference_design.motion)

    return make


def part(design, start, end, *, limit=1.0):
    """The design along a part of its motion, start to end [s], with a share of its torque."""
    period = design.motion.period
    rows = slice(round(start / period), round(end / period) + 1)
    motion = Motion(period, *(getattr(design.motion, name)[rows] for name in ("q", "v", "vd")))
    robot = dataclasses.replace(design.robot, effort_limit=limit * design.robot.effort_limit)
    loads = Loads(*(torque[rows] for torque in design.loads))
    return dataclasses.replace(design, motion=motion, loads=loads, robot=robot)


def evaluate(port, system, root):
    return port.Eval(system.GetMyContextFromRoot(root))


def names_of(diagram):
    return {system.get_name() for system in diagram.GetSystems()}


# --- step loop (Figure 4) --------------------------------------------------------------------


@pytest.fixture(scope="module")
def step_runs():
    """Gains, time and speed of axis 1 by structure, with the damping that the paper took."""
    runs = {}
    for structure, zeta in zip(STRUCTURES, (1.0, 0.95), strict=True):
        gains = tune([4.26], 65.991, [zeta])
        loop = make_step_loop(gains=gains, i_eff=4.26, structure=structure)
        simulator = make_simulator(loop, max_step=0.005)
        simulator.Initialize()
        simulator.AdvanceTo(0.5)
        time, signals = read_logs(loop, simulator.get_context())
        runs[structure] = gains, time, signals["state"][:, 1]
    return runs


@pytest.mark.parametrize(
    ("structure", "rise", "settling"), [("pi", 0.0221, 0.163), ("p_in_feedback", 0.0944, 0.1595)]
)
def test_figure_4(step_runs, structure, rise, settling):
    _, time, speed = step_runs[structure]
    metrics = step_metrics(time, speed, y0=0, y_final=1)
    assert metrics.rise_time == pytest.approx(rise, rel=0.01)
    assert metrics.settling_time == pytest.approx(settling, rel=0.01)
    if structure == "pi":  # 1 - e^-x (1 - x) has its peak at x = 2
        assert metrics.overshoot_percent == pytest.approx(100 * np.exp(-2), rel=0.01)
    else:
        assert metrics.overshoot_percent < 0.01


@pytest.mark.parametrize("structure", STRUCTURES)
def test_step_against_python_control(step_runs, structure):
    gains, time, speed = step_runs[structure]
    np.testing.assert_allclose(time, np.arange(5001) * 1e-4, rtol=0, atol=1e-15)
    kp, ki = gains.kp[0] / 4.26, gains.ki[0] / 4.26
    zero = [kp, ki] if structure == "pi" else [ki]
    _, expected = control.step_response(control.tf(zero, [1, kp, ki]), time)
    np.testing.assert_allclose(speed, expected, rtol=0, atol=1e-4)


def test_step_scales_and_logs_at_its_period():
    loop = make_step_loop(
        gains=tune([2.0], 20.0, [1.0]), i_eff=2.0, structure="pi", step=-3.0, log_period=0.01
    )
    simulator = make_simulator(loop, max_step=0.01)
    simulator.AdvanceTo(3.0)
    time, signals = read_logs(loop, simulator.get_context())
    assert len(time) == 301
    assert signals["state"][-1, 1] == pytest.approx(-3.0, abs=1e-4)


@pytest.mark.parametrize("boxed", [False, True])
@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("zeta", [0.4, 0.95, 1.7])
def test_linearized_step_loop_has_the_characteristic_polynomial(structure, zeta, boxed):
    loop = make_step_loop(
        gains=tune([4.26], 65.991, [zeta]), i_eff=4.26, structure=structure, boxed=boxed
    )
    linear = Linearize(
        loop,
        loop.CreateDefaultContext(),
        InputPortSelection.kNoInput,
        OutputPortSelection.kNoOutput,
        equilibrium_check_tolerance=np.inf,
    )
    omega_n = 65.991 / 2
    polynomial = [1, 2 * zeta * omega_n, omega_n**2, 0]  # and the angle, which nothing feels
    np.testing.assert_allclose(np.poly(linear.A()), polynomial, rtol=1e-9, atol=1e-6)


STEP = {"gains": tune([2.0], 20.0, [1.0]), "i_eff": 2.0, "structure": "pi"}


@pytest.mark.parametrize(
    "change",
    [
        {"i_eff": 0.0},
        {"i_eff": -1.0},
        {"i_eff": np.nan},
        {"log_period": 0.0},
        {"log_period": -1e-4},
        {"log_period": np.inf},
        {"structure": "pid"},
        {"gains": SpeedGains(np.array([0.0]), np.array([1.0]))},
        {"gains": SpeedGains(np.array([1.0]), np.array([-1.0]))},
        {"gains": tune([2.0, 2.0], 20.0, 1.0)},
        {"step": np.nan},
    ],
    ids=lambda change: next(iter(change)),
)
def test_bad_step_is_refused(change):
    with pytest.raises(InputError):
        make_step_loop(**{**STEP, **change})


# --- tracking: the table of an independent calculation ---------------------------------------


@pytest.fixture(scope="module")
def run(variant):
    """A recording of the whole motion with published gains; each is made once."""
    made = {}

    def get(name, **changes):
        key = name, repr(changes)
        if key not in made:
            if name.startswith("coupled"):
                changes |= {
                    "controller__omega_r": None,
                    "controller__zeta": None,
                    "controller__kp": PUBLISHED.kp,
                    "controller__ki": PUBLISHED.ki,
                }
            made[key] = simulate(variant(name, **changes))
        return made[key]

    return get


def agrees(actual, table, last_digit):
    """Within 2 %, or half a unit of the last digit that the table gives."""
    tolerance = np.maximum(0.02 * np.asarray(table), last_digit / 2)
    np.testing.assert_array_less(np.abs(actual - np.asarray(table)), tolerance)


def steady(recording):
    """Largest error of joint 2 where its speed is constant, 11 s < t < 16.5 s."""
    rows = (recording.time > 11) & (recording.time < 16.5)
    return np.abs(recording.speed_error[rows, 1]).max()


@pytest.mark.parametrize(
    ("algorithm", "i_eff", "controller", "largest"),
    [
        ("printed", I_EFF_MAX, "pi", [0.0272, 0.8688, 0.0145, 0.0546]),
        ("printed", I_EFF_MAX, "pi_ctc", [0.0271, 0.1939, 0.0099, 0.0505]),
        ("printed", I_EFF_MIN, "pi", [0.0272, 0.9001, 0.0147, 0.0526]),
        ("printed", I_EFF_MIN, "pi_ctc", [0.0271, 0.1938, 0.0099, 0.0505]),
        ("consistent", I_EFF_MAX, "pi", [0.0272, 0.2100, 0.0151, 0.0529]),
        ("consistent", I_EFF_MAX, "pi_ctc", [0.0271, 0.1939, 0.0099, 0.0505]),
    ],
)
def test_axis_loops_give_the_independent_table(run, algorithm, i_eff, controller, largest):
    recording = run(f"axis_{controller}", algorithm=algorithm, plant__i_eff=i_eff.tolist())
    agrees(np.abs(recording.speed_error).max(axis=0), largest, 1e-4)
    if i_eff is I_EFF_MAX:
        agrees(steady(recording), {"pi": 0.0470, "pi_ctc": 0.0090}[controller], 1e-4)


@pytest.mark.parametrize(
    ("controller", "algorithm", "largest", "rms", "constant", "drift_deg"),
    [
        (
            "pi",
            "consistent",
            [0.0273, 0.2085, 0.0130, 0.0539],
            [0.01606, 0.06119, 0.00660, 0.02045],
            0.0486,
            [8.3, 7.1, 0.5, 0.8],
        ),
        (
            "pi_ctc",
            "consistent",
            [0.0273, 0.1865, 0.0112, 0.0523],
            [0.01606, 0.05625, 0.00663, 0.02029],
            0.0052,
            [8.3, 5.5, 0.5, 0.7],
        ),
        (
            "pi_ctc",
            "printed",
            [0.0275, 0.9153, 0.0240, 0.0779],
            [0.01607, 0.09215, 0.00685, 0.02060],
            0.0970,
            [8.3, 8.9, 0.5, 0.8],
        ),
    ],
)
def test_coupled_loops_give_the_independent_table(
    run, controller, algorithm, largest, rms, constant, drift_deg
):
    recording = run(f"coupled_{controller}", algorithm=algorithm)
    agrees(np.abs(recording.speed_error).max(axis=0), largest, 1e-4)
    agrees(np.sqrt(np.mean(recording.speed_error**2, axis=0)), rms, 1e-5)
    agrees(steady(recording), constant, 1e-4)
    agrees(np.rad2deg(np.abs(recording.position_error).max(axis=0)), drift_deg, 0.1)


@pytest.mark.parametrize(
    ("name", "algorithm"), [("axis_pi_ctc", "printed"), ("coupled_pi_ctc", "consistent")]
)
def test_table_and_online_load_torque_are_the_same(run, name, algorithm):
    table = run(name, algorithm=algorithm)
    online = run(name, algorithm=algorithm, inverse_dynamics="online")
    for signal in ("v", "tau", "tau_cmd", "load_torque"):
        np.testing.assert_allclose(
            getattr(online, signal), getattr(table, signal), rtol=1e-9, atol=1e-9, err_msg=signal
        )


# --- independent integrations ----------------------------------------------------------------


def rk4(law, y, times, steps):
    """States at `times`, with `steps` steps of Runge and Kutta's fourth order in between.

    law(i) gives the derivative(t, y) while sample i is in force.
    """
    states = [y]
    for i, start in enumerate(times[:-1]):
        derivative = law(i)
        h = (times[i + 1] - start) / steps
        for t in start + h * np.arange(steps):
            k1 = derivative(t, y)
            k2 = derivative(t + h / 2, y + h / 2 * k1)
            k3 = derivative(t + h / 2, y + h / 2 * k2)
            k4 = derivative(t + h, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(y)
    return np.array(states)


class Controller:
    """Figures 5 and 6 in plain numpy, for several designs side by side; arrays (designs, n)."""

    def __init__(self, designs, *, widen=True):
        def side_by_side(get):
            return np.array([get(design) for design in designs])

        self.motion = designs[0].motion
        self.kp_motor = side_by_side(lambda d: d.gains.kp * GEAR)
        self.ki = side_by_side(lambda d: d.gains.ki)
        self.inertia = side_by_side(lambda d: d.i_eff * GEAR)
        self.limit = side_by_side(lambda d: d.robot.effort_limit / GEAR)
        self.load = side_by_side(lambda d: d.loads.load_torque)
        self.help = side_by_side(lambda d: widen * d.loads.alleviating_torque)

        def choices(get):
            return np.array([[float(get(design.scenario))] for design in designs])

        self.p_on_error = choices(lambda s: s.controller.structure == "pi")
        self.fed_forward = choices(lambda s: s.controller.kind == "pi_ctc")
        self.amplitude = choices(lambda s: s.disturbance.amplitude)
        self.omega_d = choices(lambda s: s.disturbance.omega_d)

    def sample(self, i):
        """tau(v, integral) while sample i is in force, and its load."""
        load, help_ = self.load[:, i], self.help[:, i]
        lower = -self.limit + np.minimum(help_, 0)
        upper = self.limit + np.maximum(help_, 0)
        fixed = self.p_on_error * self.kp_motor * self.motion.v[i] + self.fed_forward * load

        def tau(v, integral):
            tau_cmd = fixed + self.ki * integral - self.kp_motor * v
            return np.minimum(np.maximum(tau_cmd, lower), upper)

        return tau, load

    def surprise(self, t):
        """What share of the load the model does not know."""
        return self.amplitude * np.sin(self.omega_d * t)


# Share of the torque limits of each joint: they all saturate, but none is lost.
WEAK = (0.5, 0.9, 0.2, 0.15)
AXIS_CASES = [
    (controller, algorithm, structure, limit)
    for controller in ("pi", "pi_ctc")
    for algorithm, structure, limit in [
        ("printed", "p_in_feedback", (1.0,) * 4),
        ("consistent", "p_in_feedback", (1.0,) * 4),
        ("printed", "p_in_feedback", WEAK),
        ("consistent", "p_in_feedback", WEAK),
        ("consistent", "pi", (1.0,) * 4),
    ]
]


@pytest.fixture(scope="module")
def axis_runs(variant):
    """By case: recording, and the speeds of a plain numpy integration."""
    designs = [
        part(
            variant(f"axis_{controller}", algorithm=algorithm, controller__structure=structure),
            0,
            10.5,
            limit=np.array(limit),
        )
        for controller, algorithm, structure, limit in AXIS_CASES
    ]
    controllers = Controller(designs)

    def law(i):
        tau, load = controllers.sample(i)
        v_ref = controllers.motion.v[i]

        def derivative(t, y):
            v, integral = y
            vd = (tau(v, integral) - load * (1 + controllers.surprise(t))) / controllers.inertia
            return np.array([vd, GEAR * (v_ref - v)])

        return derivative

    states = rk4(law, np.zeros((2, len(designs), 4)), controllers.motion.time, steps=20)
    return {
        case: (simulate(design), states[:, 0, k])
        for k, (case, design) in enumerate(zip(AXIS_CASES, designs, strict=True))
    }


@pytest.mark.parametrize("case", AXIS_CASES, ids=str)
def test_axis_loop_against_plain_numpy(axis_runs, case):
    recording, speeds = axis_runs[case]
    saturated = np.mean(recording.tau != recording.tau_cmd, axis=0)
    if case[-1] is WEAK:
        assert np.all(saturated > 0.01)
    tolerance = 1e-4 if saturated.any() else 3e-5
    np.testing.assert_allclose(recording.v, speeds, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("duration", "limit", "widen"), [(5, 1.0, False), (3, 0.4, False), (3, 0.4, True)]
)
def test_coupled_loop_against_the_equations_of_motion(variant, duration, limit, widen):
    design = part(variant("coupled_pi_ctc", disturbance__amplitude=0.05), 0, duration, limit=limit)
    controller = Controller([design], widen=widen)
    plant = design.robot.plant
    context = plant.CreateDefaultContext()

    def law(i):
        tau, load = controller.sample(i)

        def derivative(t, y):
            q, v, integral = y
            plant.SetPositionsAndVelocities(context, [*q, *v])
            driven = GEAR * (tau(v, integral) - load * controller.surprise(t))[0]
            rest = plant.CalcGravityGeneralizedForces(context) - plant.CalcBiasTerm(context)
            vd = np.linalg.solve(plant.CalcMassMatrix(context), driven + rest)
            return np.array([v, vd, GEAR * (design.motion.v[i] - v)])

        return derivative

    states = rk4(law, np.zeros((3, 4)), design.motion.time, steps=5)
    recording = simulate(design, make_coupled_loop(design, widen_limits=widen))
    assert np.any(recording.tau != recording.tau_cmd) == (limit < 1)
    np.testing.assert_allclose(recording.v, states[:, 1], rtol=0, atol=1e-4)
    np.testing.assert_allclose(recording.q, states[:, 0], rtol=0, atol=1e-4)


# --- wiring ----------------------------------------------------------------------------------

# Every block, both plants, both ways to the load torque.
WIRINGS = [
    ("axis_pi", {}),
    ("axis_pi_ctc", {}),
    ("axis_pi_ctc", {"inverse_dynamics": "online", "controller__structure": "pi"}),
    ("coupled_pi", {}),
    ("coupled_pi_ctc", {"disturbance__amplitude": 0.05}),
    ("coupled_pi_ctc", {"inverse_dynamics": "online"}),
]


@pytest.mark.parametrize(("name", "changes"), WIRINGS)
def test_boxed_and_flat_are_the_same_loop(variant, name, changes):
    design = variant(name, **changes)
    flat, boxed = make_loop(design), make_loop(design, boxed=True)
    contexts = [diagram.CreateDefaultContext() for diagram in (flat, boxed)]
    rng = np.random.default_rng(1)
    for i in rng.integers(0, 6000, size=20):
        state = rng.normal(size=contexts[0].num_continuous_states()) * rng.choice([0.001, 0.1])
        derivatives = []
        for diagram, context in zip((flat, boxed), contexts, strict=True):
            context.SetTime(i * design.motion.period)
            context.SetContinuousState(state)
            update = diagram.EvalUniquePeriodicDiscreteUpdate(context)
            context.SetDiscreteState(update)
            context.SetTime((i + 0.7) * design.motion.period)
            derivatives.append(diagram.EvalTimeDerivatives(context).CopyToVector())
        np.testing.assert_allclose(*derivatives, rtol=1e-9, atol=1e-9)


def test_boxed_and_flat_are_the_same_step_loop():
    rng = np.random.default_rng(2)
    for structure in STRUCTURES:
        derivatives = []
        state = rng.normal(size=3)
        for boxed in (False, True):
            loop = make_step_loop(**{**STEP, "structure": structure}, boxed=boxed)
            context = loop.CreateDefaultContext()
            context.SetContinuousState(state)
            derivatives.append(loop.EvalTimeDerivatives(context).CopyToVector())
        np.testing.assert_allclose(*derivatives, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("name", "changes"), WIRINGS)
def test_boxes_are_the_blocks_that_the_scenario_asks_for(variant, name, changes):
    design = variant(name, **changes)
    boxed = make_loop(design, boxed=True)
    assert not any(isinstance(system, VectorLogSink) for system in boxed.GetSystems())
    axis, disturbed = name.startswith("axis"), design.scenario.disturbance.amplitude > 0
    online = design.scenario.inverse_dynamics == "online"
    expected = {"reference_source", "zero_order_hold", "pi_speed_controller", "dynamic_saturation"}
    expected |= {"load_torque" if online else "load_torque_table"}
    expected |= {"axis_process"} if axis else {"multibody_plant", "no_widening"}
    expected |= {"ctc_feedforward"} if name.endswith("ctc") else set()
    expected |= {"disturbance"} if disturbed else set()
    expected |= {"true_load"} if disturbed and axis else set()
    assert names_of(boxed) == expected


@pytest.mark.parametrize("boxed", [False, True])
@pytest.mark.parametrize(("name", "changes"), [w for w in WIRINGS if "online" not in w[1].values()])
def test_loops_without_python_convert_to_autodiff(variant, name, changes, boxed):
    """And have the same derivatives there; the state is small, so that no motor saturates."""
    diagram = make_loop(part(variant(name, **changes), 8, 9), boxed=boxed)
    converted = diagram.ToAutoDiffXd()
    context, own = converted.CreateDefaultContext(), diagram.CreateDefaultContext()
    state = np.random.default_rng(3).normal(size=own.num_continuous_states()) * 1e-4
    own.SetContinuousState(state)
    context.SetTimeStateAndParametersFrom(own)
    derivatives = converted.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(
        [d.value() for d in derivatives],
        diagram.EvalTimeDerivatives(own).CopyToVector(),
        rtol=1e-9,
        atol=1e-9,
    )


@pytest.mark.parametrize("boxed", [False, True])
@pytest.mark.parametrize("inverse_dynamics", ["table", "online"])
@pytest.mark.parametrize("name", ["axis_pi_ctc", "coupled_pi_ctc"])
def test_no_sample_of_delay(variant, name, inverse_dynamics, boxed):
    """From its own instant on, a sample of the reference is in force, and its load with it."""
    whole = variant(name, inverse_dynamics=inverse_dynamics, disturbance__amplitude=0.05)
    design = part(whole, 8.5, 10)
    motion, load = design.motion, design.loads.load_torque
    # A sample too late would show: the first row is not zero, and no row is like the one before.
    assert np.abs(load[0, 1]) > 100
    assert np.abs(np.diff(load, axis=0)).max(axis=1).min() > 0.01

    diagram = make_loop(design, boxed=boxed)
    hold = diagram.GetSubsystemByName("zero_order_hold")
    feedforward = diagram.GetSubsystemByName("ctc_feedforward")
    process = "axis_process" if boxed else "axis_process.inputs"
    simulator = make_simulator(diagram, max_step=motion.period)
    simulator.Initialize()
    root = simulator.get_context()
    for i in range(len(motion.q) - 1):
        simulator.AdvanceTo(i * motion.period + 0.001)
        np.testing.assert_array_equal(
            evaluate(hold.get_output_port(), hold, root),
            [*motion.q[i], *motion.v[i], *motion.vd[i]],
        )
        tau_ff = evaluate(feedforward.get_input_port(1), feedforward, root)
        np.testing.assert_allclose(tau_ff, load[i], rtol=1e-9, atol=1e-9)
        if name.startswith("axis"):
            loaded = diagram.GetSubsystemByName(process)
            true = load[i] * (1 + 0.05 * np.sin(2 * np.pi * root.get_time()))
            np.testing.assert_allclose(
                evaluate(loaded.get_input_port(1), loaded, root), true, rtol=1e-9, atol=1e-9
            )


# --- limits ----------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.01, 1.0, 1000.0])
def test_the_saturation_block_is_the_one_limiter(variant, share):
    """Torques beyond the limits in the SDF reach the links, if the block lets them through."""
    design = part(variant("coupled_pi"), 0, 1, limit=share)
    robot, limit = design.robot, share * np.array([203.2, 3950, 2150, 2150])
    loop = make_coupled_loop(design)
    root = loop.CreateDefaultContext()
    plant = loop.GetSubsystemByName("multibody_plant")
    q, v = np.array([0.3, -0.5, 0.2, 0.7]), np.array([-9.0, 3.0, -2.0, 2.5])
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), [*q, *v])
    sink = loop.GetSubsystemByName("log.tau")
    tau = evaluate(sink.get_input_port(), sink, root)
    np.testing.assert_allclose(tau, np.clip(-design.gains.kp * GEAR * v, -limit, limit))
    if share > 1:
        assert np.all(np.abs(tau) > [203.2, 3950, 2150, 2150])

    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositionsAndVelocities(context, [*q, *v])
    rest = robot.plant.CalcGravityGeneralizedForces(context) - robot.plant.CalcBiasTerm(context)
    vd = np.linalg.solve(robot.plant.CalcMassMatrix(context), GEAR * tau + rest)
    derivatives = plant.EvalTimeDerivatives(plant.GetMyContextFromRoot(root)).CopyToVector()
    np.testing.assert_allclose(derivatives, [*v, *vd], rtol=1e-9)


@pytest.mark.parametrize("plant", ["axis", "coupled", "coupled, widened"])
def test_limits_and_their_widening(variant, plant):
    """The axis loop always widens, the coupled one when it is asked to."""
    design = part(variant(f"{plant.partition(',')[0]}_pi_ctc"), 0, 10, limit=0.4)
    if plant == "axis":
        diagram = make_axis_loop(design)
    else:
        diagram = make_coupled_loop(design, widen_limits=plant.endswith("widened"))
    recording = simulate(design, diagram)
    limit = 0.4 * np.array([203.2, 3950, 2150, 2150])
    # A row has the torques of the sample before it.
    tau, tau_cmd = recording.tau[1:], recording.tau_cmd[1:]
    help_ = design.loads.alleviating_torque[:-1] * (plant != "coupled")
    lower, upper = -limit + np.minimum(help_, 0), limit + np.maximum(help_, 0)
    np.testing.assert_allclose(tau, np.clip(tau_cmd, lower, upper), rtol=1e-12)
    assert np.any(tau != tau_cmd)
    assert np.any(np.abs(tau) > limit * 1.01) == (plant != "coupled")
