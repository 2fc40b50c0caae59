"""What a design computes for its loop, once; and what it refuses."""

from __future__ import annotations

import dataclasses
import gc
from functools import cached_property
from importlib import import_module

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from variants import kind

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import ControllerChoice, with_fields
from sdt_drake.systems.gains import tune

R = np.array([67.2, 1, 1, 1])
ROTORS = np.array([0.1291, 1.73, 0.531, 0.531])  # kg m², motor side
OMEGA_R = 65.991  # rad/s
ZETA = [0.95, 0.98, 0.99, 0.95]
SLIDING = [[300.0, 60.0, 0.0, 20.0], [40.0, 0.0, 8.0, 2.0], [450.0, 60.0, 10.0, 50.0]]
LIGHT = Deviation(payload_mass=-40.0)


@pytest.fixture
def make(designed):
    """A design of the coupled plant with changed fields of its controller."""
    return lambda name="pi", **controller: designed("coupled_pi", kind(name, **controller))


def inverse_dynamics(robot, motion):
    """Return Drake's inverse dynamics with rotors, joint side, of every hundredth sample."""
    plant, context, torques = robot.plant, robot.plant.CreateDefaultContext(), []
    for q, v, vd in zip(motion.q[::100], motion.v[::100], motion.vd[::100], strict=True):
        plant.SetPositionsAndVelocities(context, [*q, *v])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        torques.append(plant.CalcInverseDynamics(context, vd, forces))
    return np.array(torques)


def link_inertia(robot, motion):
    """Return the diagonal of the mass matrix without rotors at every sample."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    diagonals = []
    for q in motion.q:
        plant.SetPositions(context, q)
        diagonals.append(plant.CalcMassMatrix(context).diagonal())
    return np.array(diagonals) - R**2 * ROTORS


@pytest.mark.parametrize("label", ["pi_id", "p_pi+id"])
def test_id_is_drakes_inverse_dynamics_with_the_rotors(make, label):
    design = make(label)
    expected = inverse_dynamics(design.robot, design.motion) / R
    np.testing.assert_allclose(design.tau_ff[::100], expected, rtol=1e-9, atol=1e-9)


def test_friction_compensation_is_added_after_the_gain(designed):
    """Coulomb, Stribeck and viscous friction."""
    gain, (f_c, b, f_b) = [0.5, 1.2, 0.0, -1.0], np.array(SLIDING)
    changes = kind("pi_id", friction_compensation=True, feedforward_gain=gain)
    design = designed("coupled_pi", changes | {"plant.friction": Friction(*SLIDING, 0.03)})
    v, s = design.motion.v, design.motion.v / 0.03
    friction = f_c * np.sign(v) + (f_b - f_c) * s * np.exp(0.5 - s**2 / 2) + b * v
    expected = gain * designed("coupled_pi", kind("pi_id")).tau_ff + friction / R
    np.testing.assert_allclose(design.tau_ff, expected, rtol=1e-12, atol=1e-12)


def test_wrong_model_changes_what_the_controller_knows_and_not_the_plant(make):
    right, wrong = make("pi_id"), make("pi_id", model=LIGHT)
    # 180 kg with the payload, 140 kg without a part of it.
    mass = wrong.model.plant.CalcTotalMass(wrong.model.plant.CreateDefaultContext())
    assert mass == pytest.approx(6570.0)
    assert wrong.robot is right.robot
    np.testing.assert_array_equal(wrong.loads, right.loads)
    np.testing.assert_array_equal(wrong.inertia.maximum, right.inertia.maximum)
    np.testing.assert_array_equal(wrong.i_eff, right.i_eff)
    np.testing.assert_array_equal(wrong.torques.total, right.torques.total)
    expected = inverse_dynamics(wrong.model, wrong.motion) / R
    np.testing.assert_allclose(wrong.tau_ff[::100], expected, rtol=1e-9, atol=1e-9)
    assert np.all(np.abs(wrong.tau_ff - right.tau_ff).max(axis=0) > 1e-3 * right.tau_ff.max(axis=0))


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_gains_are_tuned_to_the_model(make, scale):
    design = make(model=Deviation(inertia_scale=scale))
    links = link_inertia(design.robot, design.motion).max(axis=0)
    expected = tune(ROTORS + scale * links / R**2, OMEGA_R, ZETA)
    np.testing.assert_allclose(design.gains.kp, expected.kp, rtol=1e-9)
    np.testing.assert_allclose(design.gains.ki, expected.ki, rtol=1e-9)
    np.testing.assert_allclose(design.omega_n, OMEGA_R / 2, rtol=1e-12)


@pytest.mark.parametrize("model", [Deviation(), LIGHT], ids=["right", "wrong"])
def test_inertia_share_is_1_where_the_inertia_is_largest(make, model):
    design = make(model=model)
    i_eff = ROTORS + link_inertia(design.model, design.motion) / R**2
    share = design.inertia_share
    np.testing.assert_allclose(share, i_eff / i_eff.max(axis=0), rtol=1e-9)
    assert share.min(axis=0)[:2].max() < 0.95


def test_position_gain_is_a_quarter_of_the_natural_frequency_if_not_given(make):
    np.testing.assert_allclose(make("p_pi").position_gain, OMEGA_R / 8, rtol=1e-12)
    given = make("p_pi", position_gain=[1.0, 2.0, 3.0, 4.0]).position_gain
    np.testing.assert_array_equal(given, [1, 2, 3, 4])


@pytest.mark.parametrize("name", ["axis_pi", "coupled_pi"])
def test_springs_stay_whatever_they_carry(designed, name):
    elastic = {"plant.elasticity": Elasticity([60.0] * 4), "plant.i_eff": None}
    heavy = {"plant.deviation": Deviation(inertia_scale=1.5)}
    nominal, heavier = designed(name, elastic), designed(name, elastic | heavy)
    np.testing.assert_array_equal(heavier.springs.stiffness, nominal.springs.stiffness)
    np.testing.assert_array_equal(heavier.springs.damping, nominal.springs.damping)


SPRINGS = "plant.elasticity"
FREQUENCY = r"plant\.elasticity\.natural_frequency"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({SPRINGS: Elasticity([0.0, 0.0, 1e6, 0.0])},
         rf"{FREQUENCY}: gives joint 3 a pole at \S+ rad/s, expected less than 2e\+05$"),
        # A hanging gondola swings by itself, faster than at 0.1 rad/s.
        ({SPRINGS: Elasticity([0.0, 0.1, 0.1, 0.0])},
         rf"{FREQUENCY}: 0\.1 rad/s, but gravity alone makes joint \d swing with "
         r"\S+; expected more$"),
        ({"plant.friction": Friction(coulomb=[1e9] * 4)},
         r"plant\.friction: coulomb over presliding gives joint \d a pole at \S+ rad/s"),
        ({"drive": Drive(torque_bandwidth=4e4)},
         r"drive\.torque_bandwidth: gives joint 1 a pole"),
        ({"drive": Drive(n1=[1.0] * 4, n0=[1.0 + 1e-12] * 4)},
         r"drive: n0 so close to n1 gives joint \d a pole"),
        ({"drive": Drive(reference_delay=30.0)},
         r"drive\.reference_delay: 30 s, expected less than .* 30 s$"),
        # At the smallest inertia of joint 2, 66.8 kg m², but not at its largest, 98.
        ({"controller": ControllerChoice(kp=[1, 1.7e7, 1, 1], ki=[1.0] * 4)},
         r"gains .* give joint 2 a pole at 2\.54e\+05"),
        ({"controller.model": Deviation(payload_mass=-180.0)},
         r"controller\.model\.payload_mass: -180 kg"),
        ({"controller.model": Deviation(inertia_scale=1e300)},
         r"controller\.model: .*inertia"),
    ],
)  # fmt: skip
def test_what_cannot_be_or_would_make_the_simulation_crawl(designed, fields, message):
    with pytest.raises(InputError, match=rf"^scenario 'coupled_pi': {message}") as error:
        designed("coupled_pi", fields)
    assert "\n" not in str(error.value)


def test_a_replaced_scenario_that_does_not_fit_makes_no_loop(design):
    stiff = with_fields(design.scenario, {"plant.elasticity": Elasticity([0.0, 0.0, 1e6, 0.0])})
    said = r"^scenario '\w+': plant\.elasticity\.natural_frequency: gives joint 3 a pole"
    with pytest.raises(InputError, match=said):
        make_loop(dataclasses.replace(design, scenario=stiff))


def test_torques_are_computed_once_for_a_robot_and_a_motion(designed, robot, monkeypatch):
    plant, asked = import_module("sdt_drake.run.plant"), []

    def counted(robot, q, v, vd):
        if len(q) > 1:  # not of a steady state
            asked.append(robot)
        return torque_groups(robot, q, v, vd)

    monkeypatch.setattr(plant, "torque_groups", counted)
    scenario = with_fields(designed("axis_pi").scenario, {"controller.model": LIGHT})
    gc.collect()
    kept = len(plant._along)
    motion = Motion.from_speeds(0.005, np.zeros(4), np.zeros((11, 4)))
    base = make_design(scenario, robot=robot, motion=motion)
    computed = [n for n, x in vars(Design).items() if isinstance(x, property | cached_property)]
    for label in ("pi", "pi_ctc", "pi_id", "p_pi", "pi_scheduled"):
        other = base.variant(with_fields(scenario, kind(label)))
        for part in computed:
            getattr(other, part)
        other.with_feedforward(np.zeros((11, 4)))
    assert asked == [base.model, robot]
    heavier = base.variant(with_fields(scenario, {"plant.deviation": LIGHT}))
    assert heavier.robot is base.model
    assert heavier.torques is base._modelled_torques
    assert len(asked) == 2
    del base, other, heavier, motion
    gc.collect()
    assert len(plant._along) == kept
