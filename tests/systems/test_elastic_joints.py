"""Elastic joints swing and keep their energy as by hand; a loop starts at rest."""

import numpy as np
import pytest
from helpers.variants import kind
from oracles.by_hand import GEAR, ROTORS
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive, Elasticity, Friction, Springs
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate
from sdt_drake.systems import elastic_joints, robot_plant
from sdt_drake.systems.elastic_joints import set_motor_state
from sdt_drake.systems.wiring import set_state, systems_in

HANGING = np.array([0.4, 0.15, 0.1, 0.7])  # rad; roll and pitch out of balance


def test_undamped_elastic_plant_keeps_energy(robot):
    elastic, stiffness = np.array([True, True, False, True]), np.array([4e6, 2e5, 0.0, 1e5])
    springs, builder = Springs(elastic, stiffness, np.zeros(4)), DiagramBuilder()
    process = builder.AddSystem(robot_plant(robot=robot, without_rotor=elastic))
    joints = builder.AddSystem(
        elastic_joints(springs=springs, rotor_inertia=ROTORS, gear_ratio=GEAR)
    )
    none = builder.AddSystem(ConstantVectorSource(np.zeros(4))).get_output_port()
    builder.Connect(none, joints.GetInputPort("tau"))
    builder.Connect(none, process.GetInputPort("load_torque"))
    builder.Connect(process.GetOutputPort("state"), joints.GetInputPort("state"))
    builder.Connect(joints.GetOutputPort("tau_link"), process.GetInputPort("tau"))
    simulator = make_simulator(builder.Build(), period=0.001, accuracy=1e-7)
    root = simulator.get_mutable_context()
    plant = process.GetSubsystemByName("multibody_plant")
    inner = plant.GetMyContextFromRoot(root)
    moving = [*HANGING, 0.3, -1.0, 0.8, 1.5]
    set_state(process, process.GetMyMutableContextFromRoot(root), "multibody_plant", moving)
    wound = HANGING + np.array([0.002, -0.001, 0, 0.003])
    own = joints.GetMyMutableContextFromRoot(root)
    set_motor_state(joints, own, wound, [0.5, -1.2, 0, 1.0], springs=springs)
    seen = []
    for time in np.linspace(0, 0.4, 101):
        simulator.AdvanceTo(time)
        q, v = np.split(plant.GetPositionsAndVelocities(inner), 2)
        motors = joints.GetOutputPort("motor_state").Eval(joints.GetMyContextFromRoot(root))
        theta, w = np.split(motors, 2)
        seen.append([
            v @ plant.CalcMassMatrix(inner) @ v / 2,
            (GEAR**2 * ROTORS * elastic) @ w**2 / 2,
            plant.CalcPotentialEnergy(inner),
            stiffness @ (theta - q) ** 2 / 2,
        ])  # fmt: skip
    swings = np.ptp(np.array(seen), axis=0)
    assert np.all(swings > 5), swings  # every part takes part
    assert np.ptp(np.sum(seen, axis=1)) < 1e-4 * swings.min()


def test_links_on_springs_swing_at_the_given_frequency(designed):
    """Motors held, each link alone, where its inertia is largest: the force by its angle."""
    omega, zeta, h = 70.0, 0.03, 1e-4
    design = designed("coupled_pi", {"plant.elasticity": Elasticity([omega] * 4, zeta)})
    diagram = make_loop(design).diagram
    root, inside = diagram.CreateDefaultContext(), {s.get_name(): s for s in systems_in(diagram)}
    plant, joints = inside["multibody_plant"], inside["elastic_joints"]
    own, springs = plant.GetMyMutableContextFromRoot(root), design.springs
    for k, one in enumerate(np.eye(4)):
        q = design.reference.tracked.q[design.torques.d_kk[:, k].argmax()]
        motors = joints.GetMyMutableContextFromRoot(root)
        set_motor_state(joints, motors, q, np.zeros(4), springs=springs)

        def force(shift, v=0.0, q=q, one=one):
            plant.SetPositionsAndVelocities(own, [*(q + shift * one), *(v * one)])
            vd = plant.EvalTimeDerivatives(own).CopyToVector()[4:]
            return one @ plant.CalcMassMatrix(own) @ vd

        stiffness = (force(-h) - force(h)) / (2 * h)
        damping = (force(0, -h) - force(0, h)) / (2 * h)
        plant.SetPositions(own, q)
        inertia = plant.CalcMassMatrix(own)[k, k]
        assert np.sqrt(stiffness / inertia) == pytest.approx(omega, rel=1e-3)
        assert damping / (2 * omega * inertia) == pytest.approx(zeta, rel=1e-3)


# --- a run starts in equilibrium -------------------------------------------------------------

LOADED = np.array([0.2, 0.8, 0.3, 0.4])

# The controller does not know of 40 kg and the friction.
HEAVIER = {
    "plant.deviation.payload_mass": 40.0,
    "plant.friction": Friction(coulomb=[50.0, 20.0, 20.0, 10.0]),
}
AXIS = HEAVIER | {"plant.kind": "axis"}
ANTI_WINDUP = {"controller.anti_windup": True}
DRIVEN = {"drive": Drive(period=0.001, torque_bandwidth=400.0, torque_error=[0.1, -0.1, 0, 0.05])}
LATE = {"drive": Drive(reference_delay=0.012)}


@pytest.fixture
def steady(designed):
    """A run of 0.1 s at a constant speed of joint 1, all other joints standing."""

    def run(label, fields, speed=0.0):
        motion = Motion.from_speeds(0.005, LOADED, np.tile([speed, 0, 0, 0], (21, 1)))
        return simulate(designed("coupled_pi_ctc", kind(label) | fields, motion=motion))

    return run


@pytest.mark.parametrize("label", ["pi", "pi_id", "p_pi+ctc", "pi_scheduled"])
@pytest.mark.parametrize("fields", [HEAVIER, AXIS, ANTI_WINDUP, DRIVEN, LATE])
def test_steady_state_start_holds_rest_and_speed(steady, label, fields):
    """Around the vertical axis of joint 1 nothing changes with its angle."""
    recording = steady(label, fields)
    assert np.abs(recording.position_error).max() < 1e-6
    assert np.abs(recording.tau_peak[0, 1]) > 30  # joint 2 carries a load
    if fields in (HEAVIER, AXIS):
        assert np.abs(steady(label, fields, speed=1.5).speed_error).max() < 1e-5


@pytest.mark.parametrize("label", ["pi", "p_pi", "inverse_dynamics"])
def test_steady_state_start_holds_speed_with_counting_encoders(steady, label):
    """Speeds are differences of positions, the first one, too."""
    drive = {"drive": Drive(period=0.001, encoder_resolution=[2**22] * 4)}
    recording = steady(label, drive, speed=1.5)
    assert np.abs(recording.speed_error).max() < 1e-3
    assert recording.tau_peak[:, 0].max() < 20  # N m; an increment in 1 ms is 0.4 N m


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("label", ["pi", "p_pi"])
def test_steady_state_start_winds_springs_under_load(steady, label, encoder):
    springs = Elasticity([40.0] * 4, damping_ratio=0.02, encoder=encoder)
    error = steady(label, {"plant.elasticity": springs}).position_error
    np.testing.assert_allclose(error, error[:1] + np.zeros_like(error), atol=1e-6)
    assert (np.abs(error[0, 1]) > 1e-4) == (encoder == "motor")  # the link sags behind its motor
