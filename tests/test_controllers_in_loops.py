"""Controllers, drives, friction and elastic joints in the loops, against calculations by hand."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder, InputPortSelection, OutputPortSelection
from pydrake.systems.primitives import ConstantVectorSource, Linearize
from test_loops import rk4

from sdt_drake.control import CONTROLLERS
from sdt_drake.design import make_design
from sdt_drake.deviation import Deviation
from sdt_drake.device import Drive, Elasticity, Friction, FrictionParameters, Springs
from sdt_drake.dynamics import Loads
from sdt_drake.loops import PLANT_NAME, loop_period, make_loop
from sdt_drake.motion import Motion
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import make_simulator, simulate
from sdt_drake.systems import (
    axis_process_block,
    constant_block,
    elastic_joints_block,
    friction_block,
    place_flat,
    robot_plant_block,
)

R = np.array([67.2, 1, 1, 1])
ROTORS = np.array([0.1291, 1.73, 0.531, 0.531])  # kg m², motor side
LIMIT = np.array([203.2, 3950, 2150, 2150])  # N m, motor side
PERIOD = 0.005  # s
LIGHT = Deviation(payload_mass=-40.0)


@pytest.fixture(scope="session")
def designed(_reference_design):
    """A design from a shipped scenario and fields by dotted name; each is made once.

    `start` and `end` [s] cut the motion; `rest` is how many samples it rests before that.
    """
    made = {}

    def make(name, fields=None, *, start=0.0, end=None, rest=0):
        fields = fields or {}
        key = name, repr(fields), start, end, rest
        if key not in made:
            scenario = load_scenario(f"package://sdt/scenarios/{name}.yaml")
            for field, value in fields.items():
                *parents, field = field.split(".")
                target = scenario
                for parent in parents:
                    target = getattr(target, parent)
                setattr(target, field, copy.deepcopy(value))
            motion = _reference_design.motion
            if end is not None:
                v = motion.v[round(start / PERIOD) : round(end / PERIOD) + 1]
                v = np.vstack([np.zeros((rest, 4)), v])
                motion = Motion.from_speeds(PERIOD, motion.q[0], v)
            made[key] = make_design(scenario, robot=_reference_design.robot, motion=motion)
        return made[key]

    return make


@pytest.fixture(scope="session")
def run(designed):
    """A recording of such a design; each is run once."""
    made = {}

    def get(name, fields=None, **motion):
        key = name, repr(fields), repr(motion)
        if key not in made:
            made[key] = simulate(designed(name, fields, **motion))
        return made[key]

    return get


def kind(name, **fields):
    """Fields of a controller."""
    return {"controller.kind": name} | {f"controller.{f}": value for f, value in fields.items()}


def rms(recording):
    return np.sqrt(np.mean(recording.speed_error**2, axis=0))


def degrees(recording):
    """Largest error of position of each joint."""
    return np.rad2deg(np.abs(recording.position_error).max(axis=0))


def same(actual, expected, tolerance):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


# --- the reference motion --------------------------------------------------------------------


def test_whole_inverse_dynamics_leaves_a_fifteenth_of_the_speed_error(run):
    ratio = rms(run("coupled_pi")) / rms(run("coupled_pi", kind("pi_id")))
    assert np.all(ratio > 15), ratio


def test_position_loop_holds_the_position_where_pi_drifts_by_degrees(run):
    drift = degrees(run("coupled_pi"))
    assert np.all(drift > [5, 5, 0.4, 0.5])
    kept = degrees(run("coupled_pi", kind("p_pi", feedforward="id")))
    assert np.all(kept < 0.1), kept


def test_position_loop_alone_does_not_drift_either(run):
    assert np.all(degrees(run("coupled_pi", kind("p_pi"))) < 0.5)


def test_inverse_dynamics_tracks_the_position(run):
    error = degrees(run("coupled_pi", kind("inverse_dynamics")))
    assert np.all(error < 0.02), error


def test_inverse_dynamics_gives_every_joint_its_frequency_and_damping(designed):
    """Off the reference at rest, each error goes its own way: held, e'' = -2 zeta w e' - w² e."""
    fields = kind("inverse_dynamics", zeta=[0.3, 0.5, 0.7, 1.0])
    design = designed("coupled_pi", fields)
    still = Motion.from_speeds(PERIOD, np.array([0.4, 0.15, 0.1, 0.7]), np.zeros((101, 4)))
    design = dataclasses.replace(design, motion=still, loads=Loads(still.v, still.v))
    diagram = make_loop(design)
    simulator = make_simulator(diagram, max_step=PERIOD, accuracy=1e-9)
    context = simulator.get_mutable_context()
    plant = diagram.GetSubsystemByName("multibody_plant")
    e, v = np.array([1e-4, -2e-4, 1.5e-4, 3e-4]), np.zeros(4)
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), still.q[0] + e)
    zeta, omega = np.array([0.3, 0.5, 0.7, 1.0]), 65.991 / 2
    for time in still.time[1:]:
        vd = -2 * zeta * omega * v - omega**2 * e
        e, v = e + PERIOD * v + PERIOD**2 / 2 * vd, v + PERIOD * vd
        simulator.AdvanceTo(time)
        q = plant.GetPositions(plant.GetMyContextFromRoot(context))
        same(q - still.q[0], e, 5e-7)


def test_wrong_model_is_worse_on_the_same_plant(run, designed):
    right, wrong = (run("coupled_pi", kind("pi_id", model=m)) for m in (Deviation(), LIGHT))
    assert np.all(rms(wrong) > rms(right))
    assert (rms(wrong) / rms(right)).max() > 1.05

    plants = [
        make_loop(designed("coupled_pi", kind("pi_id", model=m))).GetSubsystemByName(
            "multibody_plant"
        )
        for m in (Deviation(), LIGHT)
    ]
    for state in np.random.default_rng(6).normal(size=(5, 8)):
        dynamics = []
        for plant in plants:
            context = plant.CreateDefaultContext()
            plant.SetPositionsAndVelocities(context, state)
            gravity = plant.CalcGravityGeneralizedForces(context)
            rest = [*plant.CalcMassMatrix(context).ravel(), *plant.CalcBiasTerm(context), *gravity]
            dynamics.append(rest)
        np.testing.assert_array_equal(*dynamics)


@pytest.mark.parametrize("end", [3.0])
def test_scheduled_gains_are_those_of_the_inertia_along_the_motion(designed, end):
    """The axis loop with the gains of each sample, by hand."""
    fields = kind("pi_scheduled", structure="pi") | {"algorithm": "consistent"}
    design = designed("axis_pi", fields, end=end)
    share = design.inertia_share
    assert share.min() < 0.97
    speeds = axis_by_hand(design, share=share)
    same(simulate(design).v, speeds, 3e-5)


# --- axes by hand ----------------------------------------------------------------------------


def axis_by_hand(design, *, tau_ff=None, share=None, torque_error=0.0):
    """Speeds of axes under PI with both gains on the error, in plain numpy."""
    motion, gains = design.motion, design.gains
    tau_ff = np.zeros_like(motion.v) if tau_ff is None else tau_ff
    share = np.ones_like(motion.v) if share is None else share
    load, help_ = design.loads
    lower, upper = np.minimum(help_, 0) - LIMIT, np.maximum(help_, 0) + LIMIT

    def law(i):
        def derivative(t, y):
            v, integral = y
            error = share[i] * R * (motion.v[i] - v)
            tau_cmd = tau_ff[i] + gains.kp * error + gains.ki * integral
            tau = (1 + torque_error) * np.clip(tau_cmd, lower[i], upper[i])
            return np.array([(tau - load[i]) / (design.i_eff * R), error])

        return derivative

    return rk4(law, np.zeros((2, 4)), motion.time, steps=20)[:, 0]


@pytest.mark.parametrize("feedforward", [None, "ctc", "id"])
def test_feedforward_on_axes_against_plain_numpy(designed, feedforward):
    """Of the whole inverse dynamics by Drake, where it is wanted."""
    name = {None: "pi", "ctc": "pi_ctc", "id": "pi_id"}[feedforward]
    fields = kind(name, structure="pi") | {"algorithm": "consistent"}
    design = designed("axis_pi", fields, end=4.0)
    tau_ff = None
    if feedforward == "ctc":
        tau_ff = design.loads.load_torque
    if feedforward == "id":
        plant, motion, tau_ff = design.robot.plant, design.motion, []
        context = plant.CreateDefaultContext()
        for q, v, vd in zip(motion.q, motion.v, motion.vd, strict=True):
            plant.SetPositionsAndVelocities(context, [*q, *v])
            M, bias = plant.CalcMassMatrix(context), plant.CalcBiasTerm(context)
            tau_ff.append((M @ vd + bias - plant.CalcGravityGeneralizedForces(context)) / R)
        tau_ff = np.array(tau_ff)
    recording = simulate(design)
    same(recording.v, axis_by_hand(design, tau_ff=tau_ff), 3e-5)
    if feedforward is not None:
        np.testing.assert_allclose(design.tau_ff, tau_ff, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["pi_ctc", "pi_id"])
@pytest.mark.parametrize("model", [Deviation(), LIGHT], ids=["right", "wrong"])
def test_table_and_online_feedforward_are_the_same(run, name, model):
    friction = Friction(viscous=[300.0, 20.0, 20.0, 20.0])
    fields = kind(name, model=model, friction_compensation=True, feedforward_gain=[1.1, 1, 0.9, 0])
    fields |= {"plant.friction": friction}
    table = run("coupled_pi", fields, end=3.0)
    online = run("coupled_pi", fields | {"inverse_dynamics": "online"}, end=3.0)
    same(online.v, table.v, 1e-9)
    np.testing.assert_allclose(online.tau_cmd, table.tau_cmd, rtol=1e-9, atol=1e-6)


def test_table_and_online_pi_id_are_the_same_over_the_whole_motion(run):
    table = run("coupled_pi", kind("pi_id"))
    online = run("coupled_pi", kind("pi_id") | {"inverse_dynamics": "online"})
    same(online.v, table.v, 1e-9)


# --- drives ----------------------------------------------------------------------------------

IDEAL = [
    Drive(),
    Drive(n1=[1e9] * 4, n0=[2e9] * 4, torque_error=[0.0] * 4),
]


@pytest.mark.parametrize("drive", IDEAL, ids=["default", "huge n1, n0; no error"])
@pytest.mark.parametrize("name", ["axis_pi_ctc", "coupled_pi", "coupled_pi_ctc"])
def test_ideal_drive_is_the_plain_loop(run, name, drive):
    plain, driven = (run(name, {"drive": d}, end=3.0) for d in (None, drive))
    same(driven.v, plain.v, 1e-9)
    np.testing.assert_array_equal(driven.tau, driven.tau_limited)


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_sampled_drive_converges_to_the_continuous_one(run, structure):
    def fields(drive):
        return {"algorithm": "consistent", "controller.structure": structure, "drive": drive}

    plain = run("axis_pi", fields(None), end=2.0)
    apart = [
        np.abs(run("axis_pi", fields(Drive(period=period)), end=2.0).v - plain.v).max()
        for period in (0.005, 0.0025, 0.00125, 0.000625, 0.000125)
    ]
    ratios = np.array(apart[:-1]) / apart[1:]
    assert np.all(np.diff(apart) < 0), apart
    # First order: half the period, half the difference; the last step is a fifth.
    same(ratios[:3], 2, 0.5)
    assert ratios[3] > 3.5
    assert apart[-1] < 1e-3


def test_sampled_drive_by_hand(designed):
    """Constant torque over each period: plain recursions, exact."""
    fields = {"algorithm": "consistent", "controller.structure": "pi", "drive": Drive(period=0.001)}
    design = designed("axis_pi", fields, end=2.0)
    gains, load = design.gains, design.loads.load_torque
    v, integral = np.zeros(4), np.zeros(4)
    speeds = [v]
    for i in range(len(design.motion.v) - 1):
        for _ in range(5):
            error = R * (design.motion.v[i] - v)
            tau = gains.kp * error + gains.ki * integral
            integral = integral + 0.001 * error
            v = v + 0.001 * (tau - load[i]) / (design.i_eff * R)
        speeds.append(v)
    same(simulate(design).v, speeds, 1e-8)


@pytest.mark.parametrize("count", [1, 4, 200])
@pytest.mark.parametrize("name", ["pi", "pi_ctc", "pi_id", "p_pi", "pi_scheduled"])
def test_delay_of_whole_periods_shifts_the_response_by_as_many_samples(run, name, count):
    fields = kind(name) | {"algorithm": "consistent"}
    prompt = run("axis_pi", fields, end=2.0, rest=3)
    late = run(
        "axis_pi", fields | {"drive": Drive(reference_delay=count * PERIOD)}, end=2.0, rest=3
    )
    same(late.v[count:], prompt.v[:-count], 2e-6)
    same(late.v[:count], 0, 1e-12)
    # A sample more or less would show.
    for other in (count - 1, count + 1):
        assert np.abs(late.v[other:] - prompt.v[: len(late.v) - other]).max() > 1e-3


def test_delay_of_half_a_period_is_between(run):
    fields = {"algorithm": "consistent"}
    speeds = [
        run("axis_pi", fields | {"drive": Drive(reference_delay=delay)}, end=2.0, rest=3).v
        for delay in (0.0, 0.5 * PERIOD, PERIOD)
    ]
    assert np.abs(speeds[1] - speeds[0]).max() > 1e-3
    same(speeds[1], (speeds[0] + speeds[2]) / 2, 1e-4)


def test_torque_error_on_axes_by_hand(designed):
    error = [0.2, -0.3, 0.1, -0.05]
    fields = {
        "algorithm": "consistent",
        "controller.structure": "pi",
        "drive": Drive(torque_error=error),
    }
    design = designed("axis_pi", fields, end=4.0)
    recording = simulate(design)
    same(recording.v, axis_by_hand(design, torque_error=np.array(error)), 3e-5)
    np.testing.assert_allclose(recording.tau, (1 + np.array(error)) * recording.tau_limited)
    assert np.abs(recording.v - axis_by_hand(design)).max() > 1e-3


def test_torque_loop_lags_with_its_bandwidth(run):
    """T dtau/dt = tau_limited - tau, between samples of a smooth torque."""
    drive = Drive(torque_bandwidth=20.0)
    fields = {"algorithm": "consistent", "drive": drive}
    recording = run("axis_pi", fields, end=3.0)
    lag = 1 / (2 * np.pi * 20)
    held = np.zeros((len(recording.tau), 4))
    step, tau = PERIOD, recording.tau_limited
    # First-order hold of tau_limited from row to row.
    decay = np.exp(-step / lag)
    for i in range(1, len(held)):
        slope = (tau[i] - tau[i - 1]) / step
        start = held[i - 1] - (tau[i - 1] - lag * slope)
        held[i] = tau[i] - lag * slope + decay * start
    same(recording.tau / LIMIT, held / LIMIT, 0.01)
    assert np.abs(recording.tau - recording.tau_limited).max() > 0.03 * LIMIT.min()


# --- boxed and flat --------------------------------------------------------------------------

FRICTION = Friction([300.0, 60.0, 10.0, 20.0], [40.0, 0.0, 8.0, 2.0], [450.0, 60.0, 15.0, 50.0])
ELASTICITY = Elasticity([90.0, 0.0, 0.0, 0.0], damping_ratio=0.05)
REAL = {
    "plant.friction": FRICTION,
    "plant.elasticity": ELASTICITY,
    "drive": Drive(
        period=0.00025,
        torque_bandwidth=300.0,
        torque_error=[0.01, 0.0, -0.02, 0.0],
        encoder_resolution=[2.0**20, 2.0**22, 2.0**22, 2.0**22],
        n1=[150.0, 4.0, 4.0, 4.0],
        n0=[210.0, 5.0, 6.0, 7.0],
        reference_delay=0.01,
    ),
    "disturbance.amplitude": 0.05,
    "algorithm": "consistent",
}
LOOPS = [
    *(("coupled_pi", kind(name)) for name in CONTROLLERS),
    *(("axis_pi", kind(name)) for name, k in CONTROLLERS.items() if "axis" in k.plants),
    ("coupled_pi", kind("p_pi", feedforward="id", anti_windup=True) | REAL),
    (
        "axis_pi",
        kind("pi_scheduled", feedforward="ctc", anti_windup=True, friction_compensation=True)
        | REAL,
    ),
    # Behind springs it is unstable: an increment of an encoder more or less, for a last bit, grows.
    (
        "coupled_pi",
        kind("inverse_dynamics", friction_compensation=True)
        | REAL
        | {"drive": dataclasses.replace(REAL["drive"], encoder_resolution=None)},
    ),
]


def speeds_without_logs(design, diagram):
    """At 20 instants, from rest after a reference that is not."""
    plant = diagram.GetSubsystemByName(PLANT_NAME[design.scenario.plant.kind])
    simulator = make_simulator(diagram, max_step=loop_period(design))
    simulator.Initialize()
    speeds = []
    for time in np.linspace(0, design.motion.duration, 21)[1:]:
        simulator.AdvanceTo(time)
        state = plant.GetMyContextFromRoot(simulator.get_context()).get_continuous_state_vector()
        speeds.append(state.CopyToVector()[4:8])
    return np.array(speeds)


@pytest.mark.parametrize(("name", "fields"), LOOPS, ids=range(len(LOOPS)))
def test_boxed_and_flat_loops_give_the_same_speeds(designed, name, fields):
    design = designed(name, fields, start=2.5, end=3.0)
    flat, boxed = (
        speeds_without_logs(design, make_loop(design, boxed=boxed)) for boxed in (False, True)
    )
    same(boxed, flat, 1e-6)
    assert np.abs(flat).max(axis=0).min() > 0.05


@pytest.mark.parametrize("name", ["coupled_pi", "axis_pi"])
def test_everything_real_still_follows(run, name):
    fields = kind("p_pi", feedforward="id", friction_compensation=True, anti_windup=True) | REAL
    recording = run(name, fields, end=3.0)
    # Behind a reference that is 10 ms late.
    moved = recording.v_ref[2:]
    behind = np.abs(recording.v[2:] - recording.v_ref[:-2]).max(axis=0)
    assert behind.max() < 0.1 * np.abs(moved).max(), behind


# --- friction --------------------------------------------------------------------------------

STICKY = FrictionParameters(
    coulomb=np.array([500.0, 400.0, 300.0, 100.0]),
    viscous=np.array([40.0, 5.0, 2.0, 1.0]),
    breakaway=np.array([700.0, 500.0, 300.0, 130.0]),
    stribeck_speed=0.02,
    presliding=1e-5,
)


def free_plant(robot, friction):
    """The plant with friction, no torque of the motors: diagram, plant, friction."""
    builder = DiagramBuilder()
    plant = place_flat(builder, "plant", robot_plant_block, robot=robot)
    load = place_flat(builder, "friction", friction_block, friction=friction, gear_ratio=R)
    none = place_flat(builder, "none", constant_block, signal="tau", value=np.zeros(4))
    builder.Connect(none.outputs["tau"], plant.inputs["tau"])
    builder.Connect(plant.outputs["state"], load.inputs["state"])
    builder.Connect(load.outputs["friction"], plant.inputs["load_torque"])
    diagram = builder.Build()
    return diagram, diagram.GetSubsystemByName("plant"), diagram.GetSubsystemByName("friction")


HANGING = np.array([0.4, 0.15, 0.1, 0.7])  # rad; roll and pitch out of balance


def test_friction_holds_the_plant_under_a_load(robot):
    diagram, plant, _ = free_plant(robot, STICKY)
    simulator = make_simulator(diagram, max_step=PERIOD)
    root = simulator.get_mutable_context()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), HANGING)
    load = plant.CalcGravityGeneralizedForces(plant.GetMyContextFromRoot(root))
    assert np.abs(load).max() > 200
    assert np.all(np.abs(load) < 0.9 * STICKY.coulomb)
    for time in np.arange(1, 11):
        simulator.AdvanceTo(time)
        q = plant.GetPositions(plant.GetMyContextFromRoot(root))
        same(q, HANGING, 1e-4)


def test_plant_slides_away_under_a_larger_load(robot):
    weak = dataclasses.replace(STICKY, coulomb=STICKY.coulomb / 10, breakaway=STICKY.breakaway / 10)
    diagram, plant, _ = free_plant(robot, weak)
    simulator = make_simulator(diagram, max_step=PERIOD)
    root = simulator.get_mutable_context()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), HANGING)
    simulator.AdvanceTo(1.0)
    q = plant.GetPositions(plant.GetMyContextFromRoot(root))
    assert np.abs(q - HANGING).max() > 0.05


def test_energy_of_the_plant_with_friction_never_rises(robot):
    """Kinetic, potential, and stored in the bristles, at every step of the integrator."""
    diagram, plant, friction = free_plant(robot, STICKY)
    simulator = make_simulator(diagram, max_step=0.001, accuracy=1e-7)
    root = simulator.get_mutable_context()
    plant.SetPositionsAndVelocities(
        plant.GetMyMutableContextFromRoot(root), [*HANGING, 0.05, -1.5, 1.0, 2.0]
    )
    energies, stuck = [], []

    def energy(root):
        context = plant.GetMyContextFromRoot(root)
        z = friction.GetMyContextFromRoot(root).get_continuous_state_vector().CopyToVector() * 100
        beyond = np.abs(z) > 1
        stored = STICKY.coulomb * STICKY.presliding * np.where(beyond, np.abs(z) - 0.5, z**2 / 2)
        v = plant.GetVelocities(context)
        # CalcKineticEnergy leaves out the rotors.
        kinetic = v @ plant.CalcMassMatrix(context) @ v / 2
        energies.append(kinetic + plant.CalcPotentialEnergy(context) + np.sum(stored))
        stuck.append(np.abs(v).max())

    simulator.set_monitor(lambda root: energy(root) or None)
    simulator.AdvanceTo(6.0)
    energies = np.array(energies)
    lost = energies[0] - energies[-1]
    assert len(energies) > 1000
    assert stuck[-1] < 1e-4  # at rest in the end
    assert np.diff(energies).max() < 1e-6 * lost, np.diff(energies).max() / lost


# --- elastic joints --------------------------------------------------------------------------


def locked(omega, k):
    """Frequencies of an elasticity with joint k alone elastic."""
    return Elasticity([omega if j == k else 0.0 for j in range(4)], damping_ratio=0.03)


@pytest.mark.parametrize("k", range(4))
def test_link_on_its_spring_swings_at_the_given_frequency(designed, k):
    """Motor held, other joints locked: the force on joint k by its angle, in the loop itself."""
    omega = 70.0
    design = designed("coupled_pi", {"plant.elasticity": locked(omega, k)})
    diagram = make_loop(design)
    root = diagram.CreateDefaultContext()
    plant, joints = (diagram.GetSubsystemByName(n) for n in ("multibody_plant", "elastic_joints"))
    own = plant.GetMyMutableContextFromRoot(root)
    largest = design.torques.d_kk[:, k].argmax()
    q = design.motion.q[largest]
    joints.GetMyMutableContextFromRoot(root).SetContinuousState([q[k], 0.0])  # the motor, held

    def force(shift, v=0.0):
        """On the links of joint k, with all other joints held still by their own motors."""
        plant.SetPositionsAndVelocities(own, [*(q + shift * np.eye(4)[k]), *(v * np.eye(4)[k])])
        vd = plant.EvalTimeDerivatives(own).CopyToVector()[4:]
        return (plant.CalcMassMatrix(own) @ vd)[k]

    h = 1e-4
    stiffness, damping = (
        (force(-h) - force(h)) / (2 * h),
        (force(0, -h) - force(0, h)) / (2 * h),
    )
    plant.SetPositions(own, q)
    inertia = plant.CalcMassMatrix(own)[k, k]
    # The rotor is not in it.
    with_rotor = design.robot.plant.CreateDefaultContext()
    design.robot.plant.SetPositions(with_rotor, q)
    whole = design.robot.plant.CalcMassMatrix(with_rotor)[k, k]
    assert whole - inertia == pytest.approx(R[k] ** 2 * ROTORS[k], rel=1e-9)
    assert np.sqrt(stiffness / inertia) == pytest.approx(omega, rel=1e-3)
    assert damping / (2 * omega * inertia) == pytest.approx(0.03, rel=1e-3)


def elastic_axes(springs, links):
    """Axes behind springs, no torque: a diagram with the states q, v, then theta, w."""
    builder = DiagramBuilder()
    axes = place_flat(builder, "axes", axis_process_block, i_eff=links / R**2, gear_ratio=R)
    joints = place_flat(
        builder,
        "joints",
        elastic_joints_block,
        springs=springs,
        rotor_inertia=ROTORS,
        gear_ratio=R,
    )
    for target in (axes.inputs["load_torque"], joints.inputs["tau"]):
        source = builder.AddSystem(ConstantVectorSource(np.zeros(4)))
        builder.Connect(source.get_output_port(), target)
    builder.Connect(axes.outputs["state"], joints.inputs["state"])
    builder.Connect(joints.outputs["tau_link"], axes.inputs["tau"])
    return builder.Build()


OMEGA = np.array([90.0, 120.0, 150.0, 80.0])


@pytest.fixture
def elastic_design(designed):
    return designed("axis_pi", {"plant.elasticity": Elasticity(OMEGA.tolist(), damping_ratio=0.03)})


def linear(diagram):
    return Linearize(
        diagram,
        diagram.CreateDefaultContext(),
        InputPortSelection.kNoInput,
        OutputPortSelection.kNoOutput,
    ).A()


def test_linearised_axis_swings_at_the_given_frequency(elastic_design):
    links = R**2 * (elastic_design.i_eff - ROTORS)
    A = linear(elastic_axes(elastic_design.elastic, links))
    for k in range(4):
        held = A[np.ix_([k, 4 + k], [k, 4 + k])]  # motor held
        roots = np.linalg.eigvals(held)
        np.testing.assert_allclose(np.abs(roots), OMEGA[k], rtol=1e-9)
        np.testing.assert_allclose(-roots.real / OMEGA[k], 0.03, rtol=1e-9)


def test_linearised_axis_swings_faster_where_the_motor_is_free(elastic_design):
    """omega² (1 + d / (r² I_m)): both masses against each other."""
    links = R**2 * (elastic_design.i_eff - ROTORS)
    springs = dataclasses.replace(elastic_design.elastic, damping=np.zeros(4))
    roots = np.linalg.eigvals(linear(elastic_axes(springs, links)))
    expected = OMEGA * np.sqrt(1 + links / (R**2 * ROTORS))
    swinging = np.sort(roots.imag[roots.imag > 1])
    np.testing.assert_allclose(swinging, np.sort(expected), rtol=1e-6)


def test_axis_loop_has_the_elastic_process(elastic_design):
    """Behind its springs an axis turns the links alone."""
    loop = make_loop(elastic_design)
    axes = loop.GetSubsystemByName("axis_process")
    np.testing.assert_allclose(
        np.diag(axes.B()[4:, :4]), 1 / (R * (elastic_design.i_eff - ROTORS)), rtol=1e-12
    )


def test_momentum_of_an_elastic_axis_is_kept(elastic_design):
    """With and without damping: springs act between motor and link."""
    links = R**2 * (elastic_design.i_eff - ROTORS)
    diagram = elastic_axes(elastic_design.elastic, links)
    simulator = make_simulator(diagram, max_step=0.001, accuracy=1e-8)
    context = simulator.get_mutable_context()
    start = np.random.default_rng(7).normal(size=16) * np.repeat([0.01, 1.0, 0.01, 1.0], 4)
    context.SetContinuousState(start)
    simulator.AdvanceTo(1.0)
    end = context.get_continuous_state_vector().CopyToVector()

    def momentum(state):
        return links * state[4:8] + R**2 * ROTORS * state[12:]

    assert np.abs(start[12:] - end[12:]).max() > 0.1
    np.testing.assert_allclose(momentum(end), momentum(start), rtol=1e-6)


def test_energy_of_the_elastic_plant_is_kept_without_damping(robot):
    elastic = np.array([True, True, False, True])
    stiffness = np.array([4e6, 2e5, 0.0, 1e5])
    springs = Springs(elastic, stiffness, np.zeros(4))
    builder = DiagramBuilder()
    block = place_flat(
        builder, "plant", robot_plant_block, robot=robot, loaded=False, without_rotor=elastic
    )
    joints = place_flat(
        builder,
        "joints",
        elastic_joints_block,
        springs=springs,
        rotor_inertia=ROTORS,
        gear_ratio=R,
    )
    none = builder.AddSystem(ConstantVectorSource(np.zeros(4)))
    builder.Connect(none.get_output_port(), joints.inputs["tau"])
    builder.Connect(block.outputs["state"], joints.inputs["state"])
    builder.Connect(joints.outputs["tau_link"], block.inputs["tau"])
    diagram = builder.Build()
    plant, motors = (diagram.GetSubsystemByName(n) for n in ("plant", "joints"))
    simulator = make_simulator(diagram, max_step=0.001, accuracy=1e-7)
    root = simulator.get_mutable_context()
    plant.SetPositionsAndVelocities(
        plant.GetMyMutableContextFromRoot(root), [*HANGING, 0.3, -1.0, 0.8, 1.5]
    )
    wound = HANGING[elastic] + [0.002, -0.001, 0.003]
    motors.GetMyMutableContextFromRoot(root).SetContinuousState([*wound, 0.5, -1.2, 1.0])

    def parts():
        context = plant.GetMyContextFromRoot(root)
        q, v = np.split(plant.GetPositionsAndVelocities(context), 2)
        state = motors.GetMyContextFromRoot(root).get_continuous_state_vector().CopyToVector()
        theta, w = np.split(state, 2)
        return np.array([
            v @ plant.CalcMassMatrix(context) @ v / 2,
            (R**2 * ROTORS)[elastic] @ w**2 / 2,
            plant.CalcPotentialEnergy(context),
            stiffness[elastic] @ (theta - q[elastic]) ** 2 / 2,
        ])  # fmt: skip

    seen = []
    for time in np.linspace(0, 0.4, 101):
        simulator.AdvanceTo(time)
        seen.append(parts())
    seen = np.array(seen)
    total = seen.sum(axis=1)
    # Every part takes part.
    assert np.all(np.ptp(seen, axis=0) > 5), np.ptp(seen, axis=0)
    assert np.ptp(total) < 1e-4 * np.ptp(seen, axis=0).min()


# --- anti-windup -----------------------------------------------------------------------------

HOLD = 1.0  # rad/s of joint 2
TOO_MUCH = 1.02  # of the largest torque


def overloaded(designed, structure, anti_windup):
    """Joint 2 at constant speed, its motor overloaded by 2 % from 0.5 s to 2.5 s."""
    fields = {
        "algorithm": "consistent",
        "controller.structure": structure,
        "controller.anti_windup": anti_windup,
    }
    design = designed("axis_pi", fields)
    v = np.zeros((1601, 4))
    v[:, 1] = HOLD
    motion = Motion.from_speeds(PERIOD, np.zeros(4), v)
    design = make_design(design.scenario, robot=design.robot, motion=motion)
    load = np.zeros_like(v)
    load[100:500, 1] = TOO_MUCH * LIMIT[1]
    return dataclasses.replace(design, loads=Loads(load, np.zeros_like(v)))


def time_to_settle(recording, released=2.5, share=0.02):
    """From the release until the speed stays within 2 % [s]."""
    off = np.abs(recording.v[:, 1] - HOLD) > share * HOLD
    return recording.time[np.flatnonzero(off)[-1] + 1] - released


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_anti_windup_is_back_in_less_than_half_the_time(designed, structure):
    without, with_it = (
        simulate(overloaded(designed, structure, anti_windup)) for anti_windup in (False, True)
    )
    for recording in (without, with_it):
        saturated = recording.tau[:, 1] != recording.tau_cmd[:, 1]
        rows = (recording.time > 0.8) & (recording.time <= 2.5)
        assert saturated[rows].all()
        same(recording.v[500, 1], with_it.v[500, 1], 0.02)  # as fast when it is released
    times = time_to_settle(without), time_to_settle(with_it)
    assert times[1] < 0.5 * times[0], times


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
@pytest.mark.parametrize("name", ["axis_pi", "coupled_pi"])
def test_anti_windup_does_nothing_where_nothing_saturates(run, name, structure):
    def fields(anti_windup):
        return {
            "algorithm": "consistent",
            "controller.structure": structure,
            "controller.anti_windup": anti_windup,
        }

    without, with_it = (run(name, fields(a), end=2.0) for a in (False, True))
    np.testing.assert_array_equal(with_it.tau, with_it.tau_cmd)
    same(with_it.v, without.v, 1e-12)
