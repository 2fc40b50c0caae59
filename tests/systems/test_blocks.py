"""Every block alone, without a simulator: ports, start, and what is no plain law"""

import inspect
import re
import struct
import textwrap

import numpy as np
import pytest
from alone import (
    ARGUMENTS,
    ENVELOPE,
    ERROR,
    FRICTION,
    GEAR,
    LIMIT,
    OMEGA_N,
    PERIOD,
    RESOLVED,
    ZETA,
    Alone,
    N,
    close,
    exact,
    inputs_of,
    made,
    outputs_of,
)
from command_line import ARM
from laws import CASES
from pydrake.common.yaml import yaml_load
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake import systems
from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.device import OVERFLOW_RATE, sliding_friction
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.controllers import Controller, make_controller
from sdt_drake.run.kinds import CONTROLLERS

RNG = np.random.default_rng(4)


# --- ports and pictures ----------------------------------------------------------------------

BLOCKS = [name for name in systems.__all__ if name[0].isupper()]


def picture(documented):
    """The YAML under `.. pydrake_system::` in a docstring."""
    text = re.search(
        r"^ *\.\. pydrake_system::\n((?:\n| {8}.*\n)+)", f"{documented.__doc__}\n", re.MULTILINE
    )
    assert text, f"no picture of {documented.__name__}"
    return yaml_load(data=textwrap.dedent(text[1]))


def is_drawn(system, optional=()):
    """The picture in its docstring has its ports; others it says in words."""
    kind = type(system)
    drawn = picture(kind)
    assert drawn["name"] == kind.__name__
    assert drawn.get("input_ports", []) == [i for i in inputs_of(system) if i not in optional]
    assert drawn.get("output_ports", []) == list(outputs_of(system))
    assert drawn.keys() <= {"name", "input_ports", "output_ports"}
    said = " ".join(c.__doc__ for c in kind.__mro__ if c in (kind, *kind.__bases__))
    assert set(optional) <= set(inputs_of(system))
    assert all(f"`{name}`" in said for name in optional)


def test_every_block_is_made_and_its_law_tested():
    """Here and in test_laws, but for the torques of the reference, in test_reference_torque."""
    assert set(BLOCKS) == ARGUMENTS.keys()
    here = {"InverseDynamicsController", "ReferenceSource", "RobotDrawing", "RobotPlant"}
    elsewhere = {"ReferenceTorque", "LoadTorque"}
    assert {case.block for case in CASES} | here | elsewhere | {"SignalTable"} == set(BLOCKS)


@pytest.mark.parametrize("name", BLOCKS)
def test_works_alone_in_any_builder(name, robot, meshcat):
    """With keyword arguments alone, and the ports of its picture."""
    signature = inspect.signature(getattr(systems, name))
    assert all(p.kind is p.KEYWORD_ONLY for p in signature.parameters.values())
    block = made(name, robot, **({"meshcat": meshcat} if name == "RobotDrawing" else {}))
    if name != "SymbolicLaw":  # whose ports are the caller's
        is_drawn(block)
    builder = DiagramBuilder()
    builder.AddNamedSystem("block", block)
    for port in inputs_of(block).values():
        source = builder.AddSystem(ConstantVectorSource(np.zeros(port.size())))
        builder.Connect(source.get_output_port(), port)
    for output, port in outputs_of(block).items():
        builder.ExportOutput(port, output)
    diagram = Alone(builder.Build())
    for output in outputs_of(block):
        assert np.all(np.isfinite(diagram.output(output)))


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("AxisProcess", {"i_eff": [1.0, 0.0, 2.0]}, r"i_eff: .* finite numbers > 0"),
        ("AxisProcess", {"gear_ratio": [1.0]}, r"gear_ratio: .* list of 3 finite numbers > 0"),
        ("AxisProcess", {"i_eff": 2.0}, "i_eff: 2.0, expected a list of finite"),
        ("CtcFeedforward", {"n": 0}, "n: 0, expected a whole number >= 1"),
        ("Disturbance", {"n": 1.5}, "n: 1.5, expected a whole number >= 1"),
        ("Disturbance", {"amplitude": np.nan}, "amplitude: nan, expected a finite number >= 0"),
        ("DynamicSaturation", {"n1": [1.0] * N}, "n1, n0: one is missing, expected both"),
        ("ElasticJoints", {"gear_ratio": [1.0]}, "gear_ratio: .* list of 3"),
        ("Encoder", {"period": 0}, "period: 0, expected a finite number > 0"),
        ("Encoder", {"resolution": [5.0] * N}, "gear_ratio: missing, required with a resolution"),
        ("GainSchedule", {"n": "3"}, "n: '3', expected a whole number"),
        ("InverseDynamicsController", {"zeta": [1.0]}, "zeta: .* list of 4"),
        ("JointFriction", {"gear_ratio": [1.0]}, "gear_ratio: .* list of 3"),
        ("LoadTorque", {"algorithm": "neither"}, "algorithm: 'neither', expected one of consist"),
        ("PiSpeedController", {"structure": "p"}, "structure: 'p', expected one of pi, p_in"),
        ("PositionLoop", {"position_gain": [np.inf]}, r"position_gain: \[inf\], expected"),
        ("TorqueLoop", {"motor_torque_limit": ["a"]}, r"motor_torque_limit: \['a'\], expected"),
    ],
)
def test_sizes_and_numbers_that_do_not_fit_are_one_line(name, changes, message, robot):
    """Where Drake says what it could not multiply, or ends the process."""
    with pytest.raises(InputError, match=f"^{message}") as caught:
        made(name, robot, **changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "changes", "optional"),
    [
        ("DynamicSaturation", ENVELOPE, ["state"]),
        ("PiSpeedController", {"anti_windup": True}, ["tau_cmd", "tau"]),
    ],
)
def test_further_inputs_are_said(name, changes, optional):
    is_drawn(made(name, **changes), optional)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_are_drawn(designed, name):
    kind = {"controller.kind": name}
    is_drawn(make_controller(designed("coupled_pi", kind, end=0.1)))
    inputs = {"anti_windup": (True, "tau_limited"), "feedforward": ("ctc", "load_torque")}
    for option in inputs.keys() & set(CONTROLLERS[name].options):
        value, port = inputs[option]
        fields = kind | {f"controller.{option}": value}
        system = make_controller(designed("coupled_pi", fields, end=0.1))
        assert port in inputs_of(system)
        assert f"`{port}`" in Controller.__doc__


# Of what is not listed no output follows at once: there it leaves no algebraic loop.
@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("AxisProcess", {}, {}),
        ("ElasticJoints", {}, {"tau tau_link", "state tau_link", "state motor_state"}),
        ("Encoder", {}, {}),
        ("Encoder", RESOLVED, {}),
        ("JointFriction", {}, {"state friction"}),
        ("InverseDynamicsController", {}, {"reference tau_fb", "sampled_state tau_fb"}),
        ("PositionLoop", {}, {"reference speed_reference", "sampled_state speed_reference"}),
        ("RobotPlant", {}, {}),
        ("TorqueLoop", {}, {"tau_limited tau"}),
        ("TorqueLoop", {"bandwidth": 300.0}, {}),
        ("PiSpeedController", {"anti_windup": True}, {"state tau_fb"}),
        (
            "PiSpeedController",
            {"anti_windup": True, "structure": "pi", "period": PERIOD},
            {"reference tau_fb", "state tau_fb"},
        ),
        (
            "DynamicSaturation",
            {**ENVELOPE, "widened": False},
            {"tau_cmd tau", "state tau"},
        ),
        ("LoadTorque", {}, {"reference load_torque", "reference alleviating_torque"}),
        ("ReferenceTorque", {}, {"reference (torques)"}),
    ],
)
def test_what_acts_at_once(name, changes, expected, robot):
    assert {" ".join(way) for way in Alone(name, robot, **changes).at_once()} == set(expected)


# --- start -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["AxisProcess", "RobotPlant", "ElasticJoints", "Encoder"])
def test_starts_with_a_state(name, robot):
    block = Alone(name, robot)
    n = {"RobotPlant": 4}.get(name, N)
    q, v = RNG.normal(size=(2, n))
    block.system.rest(block.context, q, v)
    if name == "ElasticJoints":  # whose rigid joints have the state of the links
        block.give(state=[*q, *v])
    output = {"ElasticJoints": "motor_state", "Encoder": "measured"}.get(name, "state")
    exact(block.output(output), [*q, *v])


def test_encoder_with_a_resolution_starts_as_if_it_had_moved_for_long():
    block = Alone("Encoder", **RESOLVED)
    assert block.timing == Alone("Encoder").timing == (0, PERIOD)
    increment = 2 * np.pi / (np.array(RESOLVED["resolution"]) * GEAR)
    q, v = RNG.normal(size=(2, N))
    block.system.rest(block.context, q, v)
    np.testing.assert_allclose(
        block.output("measured"), [*(np.floor(q / increment) * increment), *v], rtol=1e-9
    )
    block.give(state=[*q, *v])  # at time 0 it samples once more
    block.sample(0.0)
    exact(block.output("measured")[N:], np.zeros(N))


@pytest.mark.parametrize("period", [None, PERIOD])
@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_pi_starts_with_what_its_integral_gives(structure, period):
    block = Alone("PiSpeedController", structure=structure, period=period)
    tau = RNG.normal(size=N)
    block.system.rest(block.context, tau)
    block.give(reference=np.zeros(3 * N), state=np.zeros(2 * N))
    close(block.output("tau_fb"), tau)


@pytest.mark.parametrize("bandwidth", [None, 300.0])
def test_torque_loop_starts_with_what_motors_give(bandwidth):
    block = Alone("TorqueLoop", bandwidth=bandwidth, error=ERROR)
    tau = RNG.normal(size=N) * LIMIT
    block.system.rest(block.context, tau)
    block.give(tau_limited=tau / (1 + ERROR))
    close(block.output("tau"), tau)
    assert bandwidth is None or np.all(np.abs(block.derivatives()) < 1e-9)


@pytest.mark.parametrize("speed", [0.0, *np.logspace(-9, 1, 6), 0.019, 0.02])
def test_friction_starts_sliding_or_loose(speed):
    """And goes on like that."""
    block, v = Alone("JointFriction"), speed * np.array([1, -1, 1])
    block.system.rest(block.context, v)
    block.give(state=[*RNG.normal(size=N), *v])
    force = GEAR * block.output("friction")
    np.testing.assert_allclose(force, sliding_friction(FRICTION, v), rtol=1e-9, atol=1e-9)
    assert np.all(np.abs(block.derivatives()) <= 1e-8 * speed + 1e-15)


# --- what follows from the laws --------------------------------------------------------------


def test_friction_only_takes_energy_and_leads_to_steady_sliding():
    """(F - F_0) v - dW/dt >= 0, with W = int F_c clip(z / z_c) dz; any z leads to z_c + v/l."""
    block, z_c, rng = Alone("JointFriction"), FRICTION.presliding, np.random.default_rng(5)
    for _ in range(3000):
        z = rng.choice([-1, 1], size=N) * z_c * 10 ** rng.uniform(-3, 3, size=N)
        v = rng.choice([-1, 1], size=N) * 10 ** rng.uniform(-9, 1, size=N)
        block.context.SetContinuousState(z / z_c / 100)
        block.give(state=[*np.zeros(N), *v])
        force = GEAR * block.output("friction") - FRICTION.offset
        rate = 100 * z_c * block.derivatives()
        stored = FRICTION.coulomb * np.clip(z / z_c, -1, 1) * rate
        round_off = 1e-12 * (np.abs(force * v) + np.abs(stored))
        assert np.all(force * v - stored >= -round_off)
        steady = np.sign(v) * z_c + v / OVERFLOW_RATE
        assert np.all(rate * (steady - z) > 0)


def test_rigid_parts_pass_every_bit():
    """An ideal torque loop and a rigid joint: motors give just what they should."""
    loop, joints = Alone("TorqueLoop"), Alone("ElasticJoints")
    joints.context.SetContinuousState([0.1, 0.2, 0.3, 0.4])
    for scale in (1.0, 1e-300, 1e300, 0.0):
        tau = scale * np.random.default_rng(4).normal(size=N) * LIMIT
        loop.give(tau_limited=tau)
        joints.give(tau=tau, state=np.arange(6.0))
        exact(loop.output("tau"), tau)
        exact(joints.output("tau_link")[1], tau[1])
        exact(joints.output("motor_state")[[1, 4]], [1.0, 4.0])


# --- computed torque -------------------------------------------------------------------------


def computed_torque(model, reference, state):
    """r tau_fb = M(q) (wanted acceleration) + bias(q, v) - gravity(q), by the plant of `model`."""
    q_ref, v_ref, vd_ref = np.split(reference, 3)
    q, v = np.split(state, 2)
    wanted = vd_ref + 2 * ZETA * OMEGA_N * (v_ref - v) + OMEGA_N**2 * (q_ref - q)
    context = model.plant.CreateDefaultContext()
    model.plant.SetPositionsAndVelocities(context, state)
    bias = model.plant.CalcBiasTerm(context) - model.plant.CalcGravityGeneralizedForces(context)
    return (model.plant.CalcMassMatrix(context) @ wanted + bias) / model.gear_ratio, wanted


@pytest.mark.parametrize("deviation", [{}, {"payload_mass": 100.0, "inertia_scale": 1.1}])
def test_inverse_dynamics_is_computed_torque_of_its_model(robot, deviation):
    model = deviated(robot, Deviation(**deviation))
    block, plant = Alone("InverseDynamicsController", model), Alone("RobotPlant", model)
    for _ in range(5):
        reference, state = RNG.normal(size=12), RNG.normal(size=8)
        block.give(reference=reference, sampled_state=state)
        expected, wanted = computed_torque(model, reference, state)
        np.testing.assert_allclose(block.output("tau_fb"), expected, rtol=1e-9, atol=1e-6)
        # Every joint of that robot becomes a double integrator.
        plant.give(tau=block.output("tau_fb"), load_torque=np.zeros(4))
        plant.context.SetContinuousState(state)
        np.testing.assert_allclose(plant.derivatives()[4:], wanted, rtol=1e-7, atol=1e-9)
    # It has no integral: the state of Drake's PID controller has the gain 0.
    before = block.output("tau_fb")
    block.context.SetContinuousState(np.full(block.context.num_continuous_states(), 1e3))
    exact(block.output("tau_fb"), before)


# --- robot -----------------------------------------------------------------------------------

SOME = np.array([True, False, True, False])


@pytest.mark.parametrize("without_rotor", [None, ~SOME, SOME, SOME | True, SOME & False])
def test_robot_plant_moves_by_its_mass_matrix_and_clamps_nothing(robot, without_rotor):
    """M vd = r (tau - load_torque) - C + gravity; torques up to ten times the motors' limits.

    M is without the rotors that turn apart from their joints.
    """
    block = Alone("RobotPlant", robot, without_rotor=without_rotor)
    context = robot.plant.CreateDefaultContext()
    r, rotor = np.array([67.2, 1, 1, 1]), np.array([0.1291, 1.73, 0.531, 0.531])  # as published
    apart = np.zeros(4) if without_rotor is None else r**2 * rotor * without_rotor
    for share in (0.1, 1, 10):
        q, v, tau, load = RNG.normal(size=(4, robot.n))
        tau = np.copysign(share * robot.motor_torque_limit, tau)
        block.give(tau=tau, load_torque=100 * load)
        block.context.SetContinuousState([*q, *v])
        exact(block.output("state"), [*q, *v])
        robot.plant.SetPositionsAndVelocities(context, [*q, *v])
        rest = robot.plant.CalcGravityGeneralizedForces(context) - robot.plant.CalcBiasTerm(context)
        M = robot.plant.CalcMassMatrix(context) - np.diag(apart)
        vd = np.linalg.solve(M, r * (tau - 100 * load) + rest)
        np.testing.assert_allclose(block.derivatives(), [*v, *vd], rtol=1e-9)


def test_drawing_shows_the_links_where_they_are(robot, meshcat):
    block = Alone("RobotDrawing", robot, meshcat=meshcat)
    context = robot.plant.CreateDefaultContext()
    for state in RNG.normal(size=(3, 8)):
        block.give(state=state)
        block.system.ForcedPublish(block.context)
        robot.plant.SetPositionsAndVelocities(context, state)
        for name in ("arm", "gondola", "payload"):
            packed = meshcat._GetPackedTransform(f"/robot/sdt/{name}")[-16 * 9 :]
            drawn = [struct.unpack(">d", packed[9 * i + 1 : 9 * i + 9])[0] for i in range(16)]
            body = robot.plant.GetBodyByName(name)
            pose = robot.plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
            np.testing.assert_allclose(np.reshape(drawn, (4, 4)).T, pose, atol=1e-12)


def test_drawing_of_a_robot_without_shapes_has_rods_from_joint_to_joint(tmp_path, meshcat):
    (tmp_path / "arm.sdf").write_text(ARM, encoding="utf-8")
    drawing = systems.RobotDrawing(robot=load_robot(tmp_path / "arm.sdf"), meshcat=meshcat)
    inspector = drawing.scene_graph.model_inspector()
    middles = {
        inspector.GetName(part).rpartition("::")[2]: inspector.GetPoseInFrame(part).translation()
        for part in inspector.GetAllGeometryIds()
    }
    assert middles.keys() == {f"{x}_{k}" for x in ("joint", "rod", "axis", "tip") for k in (0, 1)}
    np.testing.assert_allclose(middles["rod_0"], [0.5, 0, 0], atol=1e-12)  # of 1 m
    np.testing.assert_allclose(middles["rod_1"], [0.25, 0, 0], atol=1e-12)  # to its centre of mass
    np.testing.assert_allclose(middles["joint_1"], 0, atol=1e-12)
