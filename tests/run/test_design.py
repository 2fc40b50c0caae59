"""What a design computes for its loop, once; and what it refuses."""

import dataclasses
import gc
from functools import cached_property
from importlib import import_module
from operator import attrgetter

import numpy as np
import pytest
from helpers.variants import kind
from oracles.by_hand import GEAR, inverse_dynamics

from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import watching
from sdt_drake.motion import Motion
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.run.controllers import Pi
from sdt_drake.run.design import _OLD_NAMES, Design
from sdt_drake.run.feedforward import make_feedforward
from sdt_drake.run.loop import make_loop
from sdt_drake.run.plant import torques_along
from sdt_drake.systems.gains import tune

OMEGA_R = 65.991  # rad/s
ZETA = [0.95, 0.98, 0.99, 0.95]
SLIDING = [[300.0, 60.0, 0.0, 20.0], [40.0, 0.0, 8.0, 2.0], [450.0, 60.0, 10.0, 50.0]]
LIGHT = Deviation(payload_mass=-40.0)


@pytest.fixture
def make(designed):
    """A design of the coupled plant with changed fields of its controller."""
    return lambda name="pi", **controller: designed("coupled_pi", kind(name, **controller))


def test_friction_compensation_is_not_scaled_by_the_feedforward_gain(designed):
    """Coulomb, Stribeck and viscous friction."""
    gain, (f_c, b, f_b) = [0.5, 1.2, 0.0, -1.0], np.array(SLIDING)
    changes = kind("pi_id", friction_compensation=True, feedforward_gain=gain)
    design = designed("coupled_pi", changes | {"plant.friction": Friction(*SLIDING, 0.03)})
    v, s = design.reference.tracked.v, design.reference.tracked.v / 0.03
    friction = f_c * np.sign(v) + (f_b - f_c) * s * np.exp(0.5 - s**2 / 2) + b * v
    expected = (
        gain * designed("coupled_pi", kind("pi_id")).tuning.feedforward.along + friction / GEAR
    )
    np.testing.assert_allclose(design.tuning.feedforward.along, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["pi", "pi_id"])
def test_another_feedforward_is_steady_without_the_torque_of_the_first_acceleration(designed, name):
    def along(controller, size):
        v = size * np.outer(range(3), [0.01, 0.005, 0.002, 0.001])
        motion = Motion.from_speeds(0.005, np.array([0.0, 0.4, -0.1, 0.2]), v)
        return designed("coupled_pi", kind(controller), motion=motion)

    torque, still = (along("pi_id", size).tuning.feedforward.along for size in (1, 0))
    given = along(name, 1).with_feedforward(torque).feedforward_override
    np.testing.assert_allclose(given.steady, still[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(given.along, torque)


def test_wrong_model_changes_controller_and_not_plant(make):
    right, wrong = make("pi_id"), make("pi_id", model=LIGHT)
    # 180 kg with the payload, 140 kg without a part of it.
    mass = wrong.device.model.plant.CalcTotalMass(wrong.device.model.plant.CreateDefaultContext())
    assert mass == pytest.approx(6570.0)
    assert wrong.device.simulated is right.device.simulated
    np.testing.assert_array_equal(wrong.loads, right.loads)
    np.testing.assert_array_equal(wrong.i_eff, right.i_eff)
    expected = inverse_dynamics(dataclasses.replace(wrong, nominal=wrong.device.model))
    np.testing.assert_allclose(wrong.tuning.feedforward.along, expected, rtol=1e-9, atol=1e-9)
    assert np.all(
        np.abs(wrong.tuning.feedforward.along - right.tuning.feedforward.along).max(axis=0)
        > 1e-3 * right.tuning.feedforward.along.max(axis=0)
    )


@pytest.mark.parametrize("model", [Deviation(), LIGHT, Deviation(inertia_scale=1.25)], ids=str)
def test_gains_are_tuned_to_largest_inertia_of_the_model(make, model):
    design, inertia = make(model=model), []
    plant = design.device.model.plant
    context = plant.CreateDefaultContext()
    for q in design.reference.tracked.q:
        plant.SetPositions(context, q)
        inertia.append(plant.CalcMassMatrix(context).diagonal() / GEAR**2)
    largest = np.max(inertia, axis=0)
    assert np.min(inertia / largest, axis=0)[:2].max() < 0.95
    np.testing.assert_allclose(design.tuning.inertia_share, inertia / largest, rtol=1e-9)
    expected = tune(largest, OMEGA_R, ZETA)
    np.testing.assert_allclose(design.tuning.gains.kp, expected.kp, rtol=1e-9)
    np.testing.assert_allclose(design.tuning.gains.ki, expected.ki, rtol=1e-9)


def test_position_gain_is_a_quarter_of_the_natural_frequency_if_not_given(make):
    np.testing.assert_allclose(make("p_pi").tuning.position_gain, OMEGA_R / 8, rtol=1e-12)
    given = make("p_pi", position_gain=[1.0, 2.0, 3.0, 4.0]).tuning.position_gain
    np.testing.assert_array_equal(given, [1, 2, 3, 4])


@pytest.mark.parametrize("name", ["axis_pi", "coupled_pi"])
def test_springs_keep_stiffness_under_deviation(designed, name):
    elastic = {"plant.elasticity": Elasticity([60.0] * 4), "plant.i_eff": None}
    heavy = {"plant.deviation": Deviation(inertia_scale=1.5)}
    nominal, heavier = designed(name, elastic), designed(name, elastic | heavy)
    np.testing.assert_array_equal(heavier.springs.stiffness, nominal.springs.stiffness)
    np.testing.assert_array_equal(heavier.springs.damping, nominal.springs.damping)
    is_as_before = np.array_equal(heavier.loads.load_torque, nominal.loads.load_torque)
    assert is_as_before == (name == "coupled_pi")


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
        ({"drive": Drive(torque_bandwidth=4e4)},
         r"drive\.torque_bandwidth: gives joint 1 a pole"),
        # Bristles of 4e12 N m/rad at the smallest inertia of joint 2 alone, 66.8 kg m².
        ({"plant.friction": Friction([0, 0.04, 0, 0], presliding=1e-14)},
         r"plant\.friction: coulomb over presliding gives joint 2 a pole at 2\.45e\+05"),
        ({"drive": Drive(reference_delay=30.0)},
         r"drive\.reference_delay: 30 s, expected less than .* 30 s$"),
        # At the smallest inertia of joint 2, 66.8 kg m², but not at its largest, 98.
        ({"controller": Pi(kp=[1, 1.7e7, 1, 1], ki=[1.0] * 4)},
         r"gains .* give joint 2 a pole at 2\.54e\+05"),
        ({"controller.model": Deviation(payload_mass=-180.0)},
         r"controller\.model\.payload_mass: -180 kg"),
    ],
)  # fmt: skip
def test_impossible_or_too_stiff_designs_are_refused(designed, fields, message):
    with pytest.raises(InputError, match=rf"^scenario 'coupled_pi': {message}") as error:
        designed("coupled_pi", fields)
    assert "\n" not in str(error.value)


def test_loop_of_a_design_with_too_stiff_replaced_scenario_is_refused(design):
    stiff = design.scenario.changed({"plant.elasticity": Elasticity([0.0, 0.0, 1e6, 0.0])})
    said = r"^scenario '\w+': plant\.elasticity\.natural_frequency: gives joint 3 a pole"
    with pytest.raises(InputError, match=said):
        make_loop(dataclasses.replace(design, scenario=stiff))


def test_torques_of_a_long_motion_equal_samples_with_progress(robot):
    wave = np.sin(0.01 * np.outer(np.arange(10_001), [1, 2, 3, 4]))
    motion, told = Motion.from_speeds(0.005, np.zeros(4), wave), []
    with watching(told.append):
        groups = torques_along(robot, motion)
    assert told == [0, 0, 0.5, 1]
    whole = torque_groups(robot, motion.q, motion.v, motion.vd)
    for name, values in vars(whole).items():
        np.testing.assert_array_equal(getattr(groups, name), values, err_msg=name)


def test_torques_are_computed_once_per_robot_and_motion(designed, robot, monkeypatch):
    plant, asked = import_module("sdt_drake.run.plant"), []

    def counted(robot, q, v, vd):
        asked.extend([robot] * (len(q) > 1))  # not of a steady state
        return torque_groups(robot, q, v, vd)

    monkeypatch.setattr(plant.dynamics, "torque_groups", counted)
    gc.collect()
    kept = len(plant._along)
    motion = Motion.from_speeds(0.005, np.zeros(4), np.zeros((11, 4)))
    base = designed("axis_pi", {"controller.model": LIGHT}, motion=motion)
    computed = [n for n, x in vars(Design).items() if isinstance(x, property | cached_property)]
    for label in ("pi", "pi_ctc", "pi_id", "p_pi", "pi_scheduled"):
        other = base.variant(base.scenario.changed(kind(label)))
        for part in computed:
            getattr(other, part)
    heavier = base.variant(base.scenario.changed({"plant.deviation": LIGHT}))
    assert heavier.device.simulated is base.device.model and heavier.torques is plant.torques_along(
        base.device.model, base.reference.tracked
    )
    assert asked == [base.device.model, robot]
    del base, other, heavier, motion
    gc.collect()
    assert len(plant._along) == kept


# --- device, reference and tuning -------------------------------------------------------------


def test_design_names_of_0_4_work_and_warn(designed):
    design = designed("coupled_pi_ctc", end=0.1)
    for old, new in _OLD_NAMES.items():
        with pytest.warns(
            DeprecationWarning, match=rf"design\.{old} is design\.{new} now, and goes in"
        ):
            assert np.all(getattr(design, old) == attrgetter(new)(design))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = design.nonsense


def test_wrong_model_sets_gains_and_told_inertia(designed):
    """The loads of the loop are those of the nominal robot, whatever the controller believes."""
    right = designed("coupled_pi", end=0.1)
    wrong = designed("coupled_pi", {"controller.model": LIGHT}, end=0.1)
    found = wrong.tuning
    np.testing.assert_allclose(found.gains.ki, (OMEGA_R / 2) ** 2 * found.inertia.maximum)
    assert np.all(found.inertia.maximum < right.tuning.inertia.maximum)  # 40 kg less
    np.testing.assert_array_equal(wrong.inertia.maximum, right.inertia.maximum)
    np.testing.assert_allclose(found.numbers["zeta_max"], ZETA, rtol=1e-12)
    assert "omega_r = 65.991 rad/s" in str(found)


@pytest.mark.parametrize(
    ("fields", "is_load"),
    [
        ({}, True),
        ({"controller.model": Deviation(inertia_scale=1.0, payload_mass=0.0)}, True),
        ({"controller.model": LIGHT}, False),
        ({"controller.feedforward_gain": [0.9] * 4}, False),
        ({"plant.deviation": LIGHT}, True),  # a coupled plant is told the nominal load
    ],
)
def test_feedforward_equals_load_torque_only_under_equal_deviation(designed, fields, is_load):
    design = designed("coupled_pi_ctc", fields, end=0.1)
    block = make_feedforward(design, adds=True, feeds=("load_torque",))
    assert block.HasSubsystemNamed("feedforward_table") != is_load
    along = design.tuning.feedforward.along
    assert np.allclose(along, design.loads.load_torque, rtol=1e-12) == is_load
