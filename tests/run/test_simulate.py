"""Running a loop, and its recording; also of robots other than the reference device."""

import copy
import dataclasses
import re
from dataclasses import replace

import numpy as np
import pytest
from by_hand import LIMIT
from command_line import ELBOW, JOINT, LINK
from variants import weaker

from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import LIMITS, write_table
from sdt_drake.motion import Motion
from sdt_drake.run.design import make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import ControllerChoice, PlantChoice, Scenario
from sdt_drake.run.simulate import Recording, _beyond_stop, simulate

PLANTS = ("axis", "coupled")
SIGNALS = ("q_ref", "v_ref", "q", "v", "tau_cmd", "tau", "load_torque")
COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
    "tau_peak", "tau_rms", "tau_mean", "saturated", "beyond_stop",
)  # fmt: skip


@pytest.fixture(scope="module")
def designs(designed):
    """By plant: PI + CTC, disturbed, 2 s, with motors that are too weak by 40 %."""
    fields = {plant: {"plant.kind": plant, "disturbance.amplitude": 0.05} for plant in PLANTS}
    return {
        plant: weaker(designed("coupled_pi_ctc", fields[plant], end=2.0), 0.6) for plant in PLANTS
    }


@pytest.fixture(scope="module")
def recordings(designs):
    return {plant: simulate(design) for plant, design in designs.items()}


# --- recording -------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", PLANTS)
def test_recording_has_every_sample(designs, recordings, plant):
    motion, recording = designs[plant].motion, recordings[plant]
    np.testing.assert_array_equal(recording.time, np.arange(401) * 0.005)
    for name in SIGNALS:
        values = getattr(recording, name)
        assert values.shape == (401, 4), name
        assert np.all(np.isfinite(values)), name
    np.testing.assert_array_equal(recording.q_ref, motion.q)
    np.testing.assert_array_equal(recording.v_ref, motion.v)
    np.testing.assert_array_equal(recording.speed_error, recording.v - motion.v)
    np.testing.assert_array_equal(recording.position_error, recording.q - motion.q)


@pytest.mark.parametrize("plant", PLANTS)
def test_torques_are_those_before_the_update(designs, recordings, plant):
    """Row i has the load and the limits of sample i - 1, and the speed at its own time."""
    design, recording = designs[plant], recordings[plant]
    load, help_ = design.loads
    np.testing.assert_array_equal(recording.load_torque[1:], load[:-1])
    limit = 0.6 * LIMIT
    help_ = help_[:-1] if plant == "axis" else np.zeros((400, 4))
    lower, upper = -limit + np.minimum(help_, 0), limit + np.maximum(help_, 0)
    np.testing.assert_allclose(
        recording.tau[1:], np.clip(recording.tau_cmd[1:], lower, upper), rtol=1e-12
    )
    assert np.any(recording.tau != recording.tau_cmd)
    # tau_cmd - tau_ff = K_IS integral - K_PS r v; the integral is that of the held reference.
    r = design.robot.gear_ratio
    held = np.cumsum(design.motion.v[:-1], axis=0) * design.motion.period
    integral = r * (held - (recording.q[1:] - recording.q[0]))
    expected = design.gains.ki * integral - design.gains.kp * r * recording.v[1:] + load[:-1]
    np.testing.assert_allclose(recording.tau_cmd[1:], expected, rtol=1e-6, atol=0.01)


@pytest.mark.parametrize("plant", PLANTS)
def test_csv_is_exact(recordings, plant, tmp_path):
    recording = recordings[plant]
    recording.to_csv(tmp_path / "run.csv")
    header, *rows = (tmp_path / "run.csv").read_text().splitlines()
    names = [f"{name}_{k}" for name in COLUMNS for k in (1, 2, 3, 4)]
    assert header == ",".join(["time", *names])
    data = np.array([row.split(",") for row in rows], dtype=float)
    expected = [recording.time[:, None], *(getattr(recording, name) for name in COLUMNS)]
    np.testing.assert_array_equal(data, np.hstack(expected))

    back = Recording.from_csv(tmp_path / "run.csv")
    same_bits(back, recording)
    assert back.tau_limited.tobytes() == recording.tau_limited.tobytes()


def write_columns(path, names, n=2):
    """A table with these columns, `name` or `name:joints`, and two rows of zeros."""
    pairs = [(name.partition(":")[0], int(name.partition(":")[2] or n)) for name in names]
    header = ["time", *(f"{name}_{k + 1}" for name, joints in pairs for k in range(joints))]
    rows = [",".join([time, *["0"] * (len(header) - 1)]) for time in ("0", "0.005")]
    path.write_text("\n".join([",".join(header), *rows]), encoding="utf-8")
    return path


READ = (
    "q_ref", "v_ref", "q", "v", "tau_cmd", "tau_limited", "tau", "load_torque",
    "tau_peak", "tau_rms", "tau_mean", "saturated", "beyond_stop",
)  # fmt: skip


@pytest.mark.parametrize("missing", ["q_ref", "beyond_stop"])
def test_a_recording_without_a_column_is_refused(tmp_path, missing):
    path = write_columns(tmp_path / "run.csv", [name for name in READ if name != missing])
    with pytest.raises(InputError) as caught:
        Recording.from_csv(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: no column {missing}_1, expected") and "\n" not in message
    assert "has to be simulated again" in message


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("q", 1.1e6, "q_2 is 1.1e+06 rad at 0.005 s, expected at most 1e+06 rad"),
        ("q_ref", -1.1e6, "q_ref_2 is -1.1e+06 rad"),
        ("v", -1.1e4, "v_2 is -11000 rad/s at 0.005 s, expected at most 10000 rad/s"),
        ("v_ref", 1e300, "v_ref_2 is 1e+300 rad/s"),
    ],
)
def test_what_no_joint_does_is_refused(tmp_path, name, value, message):
    columns = {other: np.zeros((2, 2)) for other in READ}
    columns[name][1, 1] = value
    write_table(tmp_path / "run.csv", np.array([0, 0.005]), columns)
    with pytest.raises(InputError, match=re.escape(f"run.csv: {message}")):
        Recording.from_csv(tmp_path / "run.csv")
    columns[name][1, 1] = np.sign(value) * LIMITS[name][0]
    write_table(tmp_path / "run.csv", np.array([0, 0.005]), columns)
    assert Recording.from_csv(tmp_path / "run.csv").time[-1] == 0.005


def test_time_in_steps_that_nobody_records_is_refused(tmp_path):
    columns = {name: np.zeros((3, 2)) for name in READ}
    write_table(tmp_path / "run.csv", 1e-7 * np.arange(3), columns)
    with pytest.raises(InputError, match=r"run\.csv: time in steps of 1e-07 s, expected at least"):
        Recording.from_csv(tmp_path / "run.csv")


def same_bits(first, second):
    for name in ("time", *SIGNALS):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes(), name


@pytest.mark.parametrize("inverse_dynamics", ["table", "online"])
@pytest.mark.parametrize("plant", PLANTS)
def test_runs_repeat_bit_for_bit(designs, plant, inverse_dynamics):
    scenario = copy.deepcopy(designs[plant].scenario)
    scenario.inverse_dynamics = inverse_dynamics
    design = dataclasses.replace(designs[plant], scenario=scenario)
    first = simulate(design)
    diagram = make_loop(design)
    same_bits(first, simulate(design, diagram))
    same_bits(first, simulate(design, diagram))  # nothing is left over in a diagram


# --- other robots ----------------------------------------------------------------------------

SHOULDER = JOINT.format(name="shoulder", pose="", parent="world", child="upper")
ELBOW_TOO = JOINT.format(name="elbow", pose=ELBOW, parent="upper", child="lower")
UPPER = LINK.format(name="upper", pose="") + SHOULDER.replace(">20<", ">35<")
LOWER = LINK.format(name="lower", pose="<pose relative_to='elbow'/>") + ELBOW_TOO
VERTICAL = "0 0 1"


def chain(folder, n, *, plant, axis="0 1 0", period=0.005, inverse_dynamics="table"):
    """240 periods of a robot of one or two links, with another axis of the first one: each joint
    speeds up, holds, and stops."""
    links = UPPER.replace("0 1 0", axis) + (n - 1) * LOWER
    path = folder / "chain.sdf"
    path.write_text(
        f"<sdf version='1.9' xmlns:drake='drake.mit.edu'><model name='chain'>{links}</model></sdf>"
    )
    scenario = Scenario(
        robot=str(path),
        period=period,
        plant=PlantChoice(kind=plant),
        controller=ControllerChoice(kind="pi_ctc", omega_r=60.0),
        inverse_dynamics=inverse_dynamics,
    )
    course = np.interp(np.arange(241), [0, 72, 168, 240], [0, 1, 1, 0])
    v = np.outer(course, [0.4, -0.8][:n])
    return make_design(scenario, motion=Motion.from_speeds(period, np.zeros(n), v))


@pytest.mark.parametrize("inverse_dynamics", ["table", "online"])
@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("plant", PLANTS)
def test_other_numbers_of_joints(tmp_path, plant, n, inverse_dynamics):
    how = {"plant": plant, "inverse_dynamics": inverse_dynamics}
    recording = simulate(chain(tmp_path, n, axis=VERTICAL, **how))
    assert recording.v.shape == recording.tau.shape == (241, n)
    # omega_n = 30 rad/s and zeta = 1: the loop lags by 2 zeta / omega_n times the acceleration.
    acceleration = np.abs(np.diff(recording.v_ref, axis=0)).max() / 0.005
    largest = np.abs(recording.speed_error).max()
    assert 0.5 * acceleration / 15 < largest < 1.5 * acceleration / 15
    np.testing.assert_allclose(recording.v[-1], 0, atol=1.2 * acceleration / 15)
    recording.to_csv(tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text().partition("\n")[0]
    assert header.count(",") == 14 * n
    assert header.endswith(f"beyond_stop_{n}")


def test_one_joint_is_the_same_robot_in_both_plants(tmp_path):
    """Nothing to couple with, no gravity about the axis: the plants are one equation."""
    axis, coupled = (simulate(chain(tmp_path, 1, plant=p, axis=VERTICAL)) for p in PLANTS)
    np.testing.assert_allclose(axis.v, coupled.v, rtol=0, atol=1e-5)
    np.testing.assert_allclose(axis.tau, coupled.tau, rtol=0, atol=1e-3)
    assert not axis.load_torque.any()


@pytest.mark.parametrize("period", [1 / 300, 0.007])
@pytest.mark.parametrize("plant", PLANTS)
def test_any_period_is_met_exactly(tmp_path, plant, period):
    """No sample early, late or twice, whatever its time is in binary."""
    design = chain(tmp_path, 2, plant=plant, axis=VERTICAL, period=period)
    recording = simulate(design)
    np.testing.assert_array_equal(recording.time, np.arange(241) * period)
    np.testing.assert_array_equal(recording.load_torque[1:], design.loads.load_torque[:-1])


def test_how_far_a_joint_is_beyond_its_stop(designs):
    """Stops do not act; the axis plant has none."""
    q = np.array([[0.0, -1.5, 2.25, 2.0]])
    for plant, expected in (("coupled", [0, 0.5, 0.25, 0]), ("axis", [0, 0, 0, 0])):
        robot = designs[plant].robot
        robot = replace(robot, position_lower=np.full(4, -1.0), position_upper=np.full(4, 2.0))
        design = replace(designs[plant], nominal=robot)
        np.testing.assert_array_equal(_beyond_stop(design, q), [expected])
