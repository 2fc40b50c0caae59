"""The chosen device against calculations by hand, and the catalogue that it is chosen from."""

import dataclasses
import re

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.device import Drive
from sdt_drake.robot.dynamics import effective_inertia, torque_groups
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.motors import DeviceChoice, chosen_robot, load_catalogue, motors_in_use
from sdt_drake.robot.parsed import check_dynamics
from sdt_drake.robot.robot import edited
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario

FITTED = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]
LIGHTER = ["AC-150", "TM-2860", "TM-1430", "TM-716"]
ROTORS = [0.0953, 0.706, 0.353, 0.177]  # of the lighter motors [kg m²]
MASS = {motor.id: motor.mass for motor in load_catalogue().motors}
ARM, PAYLOAD = 2.6, 180.0  # m, kg
Q = np.random.default_rng(5).uniform(-3, 3, size=(8, 4))  # rad


def links(robot, q):
    """Mass matrix of the links, joint side [kg m²]."""
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, q)
    return robot.plant.CalcMassMatrix(context) - np.diag(robot.reflected_inertia)


def total_mass(robot) -> float:
    return robot.plant.CalcTotalMass(robot.plant.CreateDefaultContext())


CHOICES = {
    "lighter": ({"motors": LIGHTER, "fitted": FITTED}, [150, 2860, 1430, 716], ROTORS, 67.2),
    "one motor": (
        {"motors": ["", "TM-2860", "", ""], "fitted": FITTED},
        [203.2, 2860, 2150, 2150],
        [0.1291, ROTORS[1], 0.531, 0.531],
        67.2,
    ),
    "gears alone": ({"gear_ratio": [50, 1, 1, 1]}, [203.2, 3950, 2150, 2150], None, 50),
}


@pytest.mark.parametrize("fields, torque, rotors, ratio", CHOICES.values(), ids=CHOICES)
def test_chosen_motors_set_limits_rotors_and_gears(robot, fields, torque, rotors, ratio):
    other = chosen_robot(robot, DeviceChoice(**fields))
    ratios = [ratio, 1, 1, 1]
    np.testing.assert_allclose(other.effort_limit, np.multiply(torque, ratios), rtol=1e-15)
    np.testing.assert_array_equal(other.rotor_inertia, rotors or robot.rotor_inertia)
    np.testing.assert_array_equal(other.gear_ratio, ratios)
    np.testing.assert_array_equal(other.velocity_limit, robot.velocity_limit)
    if rotors is None:  # the motors of the SDF
        assert other.frequency_factor == 1
        np.testing.assert_array_equal(links(other, Q[0]), links(robot, Q[0]))


def test_motor_masses_are_added_to_the_inboard_link(robot):
    """Joint 1 stands on the ground; the others 2.6 m from its axis, on their own axes."""
    other = chosen_robot(robot, DeviceChoice(motors=LIGHTER, fitted=FITTED))
    moving = sum(MASS[new] - MASS[old] for new, old in zip(LIGHTER[1:], FITTED[1:], strict=True))
    assert total_mass(other) == pytest.approx(total_mass(robot) + moving, rel=1e-14)
    after, before = (torque_groups(r, Q, 0 * Q, 0 * Q) for r in (other, robot))
    by_hand = np.add(before.d_kk, [moving * ARM**2, 0, 0, 0])
    np.testing.assert_allclose(after.d_kk, by_hand, rtol=1e-12)
    np.testing.assert_allclose(after.gravity, before.gravity, atol=1e-9)  # the axes meet there


def test_structure_scale_leaves_payload_and_motors(robot):
    s, heavier = 0.7, deviated(robot, Deviation(payload_mass=PAYLOAD))
    other = chosen_robot(robot, DeviceChoice(structure_scale=s))
    assert total_mass(other) == pytest.approx(s * (total_mass(robot) - PAYLOAD) + PAYLOAD)
    for q in Q:
        payload = links(heavier, q) - links(robot, q)
        by_hand = s * (links(robot, q) - payload) + payload
        np.testing.assert_allclose(links(other, q), by_hand, rtol=1e-9, atol=1e-9)
    # Motors that are kept do not scale, either: s (M - m_f) + m.
    motors = ["", "TM-5270", "", "TM-1430"]
    other = chosen_robot(robot, DeviceChoice(motors, structure_scale=s, fitted=FITTED))
    fitted, new = MASS["TM-3950"] + 2 * MASS["TM-2150"], MASS["TM-5270"] + 85 + MASS["TM-1430"]
    by_hand = s * (total_mass(robot) - PAYLOAD - fitted) + PAYLOAD + new
    assert total_mass(other) == pytest.approx(by_hand, rel=1e-14)


@pytest.mark.parametrize("s, p", [(0.7, 1.0), (1.3, 3.0)])
def test_structure_frequency_follows_scale_and_load(robot, s, p):
    other = chosen_robot(robot, DeviceChoice(structure_scale=s, stiffness_exponent=p))
    before, after = (links(r, np.zeros(4))[0, 0] for r in (robot, other))
    assert other.frequency_factor == pytest.approx(np.sqrt(s**p * before / after), rel=1e-12)
    # An edit of it, and a choice after a choice, go on from there.
    assert edited(other, lambda root: None).frequency_factor == other.frequency_factor
    again = chosen_robot(other, DeviceChoice(structure_scale=1 / s, stiffness_exponent=p))
    assert again.frequency_factor == pytest.approx(1, rel=1e-12)


HEAVY = {"motors": ["", "", "TM-716", ""], "fitted": ["", "", "TM-5270", ""]}
BAD = [
    ({"motors": ["AC-203", "TM-999", "", ""]}, "device.motors[2]: no motor 'TM-999'"),
    ({"motors": LIGHTER, "gear_ratio": [67.2, 2, 1, 1]}, "device.gear_ratio[2]: 2, but TM-2860"),
    ({"structure_scale": 2, "payload": "seat"}, "device.payload: no link 'seat', expected one of"),
    (HEAVY, "device: link 'roll_frame' would be left with -90 kg"),
]


@pytest.mark.parametrize("values, message", BAD)
def test_device_with_bad_choice_is_refused(robot, values, message):
    light = deviated(robot, Deviation(link_scales=[1, 0.2, 1, 1, 1]))  # roll_frame: 60 kg
    with pytest.raises(InputError, match="^" + re.escape(message)):
        chosen_robot(light, DeviceChoice(**{"fitted": FITTED} | values))


def test_chosen_device_reaches_planner_controller_and_plant(robot, design):
    fields = {"device.motors": LIGHTER, "device.structure_scale": 0.8, "device.fitted": FITTED}
    scenario = load_scenario("coupled_pi_ctc").changed(fields)
    made = make_design(scenario, motion=design.reference.tracked)
    chosen = chosen_robot(robot, DeviceChoice(LIGHTER, structure_scale=0.8, fitted=FITTED))
    for known in (made.device.simulated, made.nominal, made.device.model):
        np.testing.assert_array_equal(known.effort_limit, chosen.effort_limit)
        assert total_mass(known) == total_mass(chosen)
    d_kk = torque_groups(
        chosen, made.reference.tracked.q, made.reference.tracked.v, made.reference.tracked.vd
    ).d_kk
    i_eff = effective_inertia(chosen, d_kk).max(axis=0)
    omega_n = 0.5 * 65.991 * chosen.frequency_factor
    np.testing.assert_allclose(made.tuning.gains.ki, omega_n**2 * i_eff, rtol=1e-12)
    assert chosen.frequency_factor != 1


# --- the catalogue -----------------------------------------------------------------------------

MOTOR = """
  - {id: M1, kind: torque motor, peak_torque: 100, rated_torque: 40, rotor_inertia: 0.1,
     n1_rpm: 60, n0_rpm: 120, mass: 10, thermal_time_constant: 180, source: illustrative}
"""


def test_catalogue_rpm_become_rad_per_s(tmp_path):
    (tmp_path / "motors.yaml").write_text("motors:" + MOTOR)
    (motor,) = load_catalogue(tmp_path / "motors.yaml").motors
    assert (motor.n1, motor.n0) == pytest.approx((2 * np.pi, 4 * np.pi), rel=1e-15)
    assert motor.gear_ratio == 1


BAD_MOTORS = [
    ("n0_rpm: 120", "n0_rpm: 60", "motors[1].n0_rpm: 60, expected more than n1_rpm, 60"),
    ("mass: 10", "gear_ratio: 2, mass: 10", "motors[1].gear_ratio: 2, but a torque motor dri"),
    (MOTOR, MOTOR + MOTOR, "motors[2].id: 'M1' is given twice"),
]  # fmt: skip


@pytest.mark.parametrize("old, new, message", BAD_MOTORS, ids=[case[-1] for case in BAD_MOTORS])
def test_bad_motor_is_refused_with_file_and_field(tmp_path, old, new, message):
    path = tmp_path / "motors.yaml"
    path.write_text("motors:" + MOTOR.replace(old, new))
    with pytest.raises(InputError) as error:
        load_catalogue(path)
    (line,) = error.value.lines
    assert line.startswith(f"{path}: {message}")


def test_envelope_of_the_motors_is_in_rad_per_s_and_names_joints_without(robot):
    """Of the catalogue in rpm; the first joint keeps the motor of the SDF."""
    catalogue = {motor.id: motor for motor in load_catalogue().motors}
    other = chosen_robot(robot, DeviceChoice(motors=LIGHTER, fitted=FITTED)).envelope
    rpm = [[catalogue[name].n1_rpm, catalogue[name].n0_rpm] for name in LIGHTER]
    np.testing.assert_allclose(np.transpose([other.n1, other.n0]), np.pi / 30 * np.array(rpm))
    assert chosen_robot(robot, DeviceChoice(gear_ratio=[50, 1, 1, 1])).envelope is None
    assert [
        motor.id for motor in motors_in_use(DeviceChoice(motors=LIGHTER, fitted=FITTED), 4)
    ] == LIGHTER
    first = chosen_robot(robot, DeviceChoice(fitted=["AC-203", "", "TM-2150", ""])).envelope
    assert first.source.endswith("; without any: joint 2, 4, no n1_rpm and n0_rpm")


def test_speed_share_is_that_of_joint_or_motor(robot):
    fast = dataclasses.replace(
        robot,
        velocity_limit=np.array([4.0, 8, np.inf, np.inf]),
        envelope=Envelope(np.full(4, 1.0), 67.2 * np.array([8.0, 4 / 67.2, 2, 1]), "a test"),
    )
    share = fast.speed_share(np.array([-2.0, 2, 0, 0]))
    np.testing.assert_allclose(share, [0.5, 0.5, 0, 0])


@pytest.mark.parametrize("given, missing", [("n1", "n0"), ("n0", "n1")])
def test_drive_names_the_missing_end_of_an_envelope(given, missing):
    with pytest.raises(InputError, match=f"{missing}: missing, expected n1 and n0 or neither"):
        Drive(**{given: [1.0] * 4})


def test_joint_must_move_a_share_of_the_largest_inertia():
    check_dynamics(np.diag([1e-11, 1.0]), ["a", "b"], "file")
    with pytest.raises(InputError, match="joint 'a': inertia about its axis 1e-13 kg m²"):
        check_dynamics(np.diag([1e-13, 1.0]), ["a", "b"], "file")
