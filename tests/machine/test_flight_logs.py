"""Logs as they are: noise, attitude instead of rates, shipped mappings, rates that contradict."""

import re

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.flight import FlightColumns, make_flight, read_flight
from sdt_drake.machine.diagnose.flight import check_flight
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.pilot.head import GRAVITY

RNG = np.random.default_rng(3)


def a_turn(period=0.05, seconds=40.0):
    """Time, bank, pitch, heading [rad] and rates x forward, y right, z down [rad/s] of a turn.

    The rates are those of rotations by heading, pitch and bank, by small differences of matrices.
    """
    time = np.arange(0, seconds, period)

    def angles(t):
        ease = np.sin(np.pi * t / seconds) ** 2
        return np.stack(
            [0.9 * ease * np.sin(0.5 * t), 0.25 * np.sin(0.3 * t), 0.02 * t + 0.002 * t**2]
        )

    def matrix(t):
        (a, b, c), zero, one = angles(t), 0 * t, 1 + 0 * t
        x = [[one, zero, zero], [zero, np.cos(a), -np.sin(a)], [zero, np.sin(a), np.cos(a)]]
        y = [[np.cos(b), zero, np.sin(b)], [zero, one, zero], [-np.sin(b), zero, np.cos(b)]]
        z = [[np.cos(c), -np.sin(c), zero], [np.sin(c), np.cos(c), zero], [zero, zero, one]]
        x, y, z = (np.moveaxis(np.array(one), 2, 0) for one in (x, y, z))
        return z @ y @ x

    h = 1e-5
    skew = matrix(time).swapaxes(1, 2) @ (matrix(time + h) - matrix(time - h)) / (2 * h)
    rates = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    return time, angles(time).T, rates


def written(path, time, **columns):
    table = np.column_stack([time, *columns.values()])
    header = ",".join(["time", *columns])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def test_rates_and_forward_force_follow_from_attitude_at_1_hz(tmp_path):
    time, angles, _ = a_turn(period=1.0)
    speed = 100 + 5 * np.sin(0.2 * time)
    bank, pitch, heading = np.degrees(angles).T
    file = written(tmp_path / "slow.csv", time, roll=bank, pitch=pitch, hdg=heading % 360,
                   lat=0 * time, norm=0 * time, v=speed / 0.5144)  # fmt: skip
    mapping = FlightColumns(
        force=("", "lat", "norm"), omega=(), attitude=("roll", "pitch", "hdg"), force_unit="g",
        speed="v", speed_factor=0.5144, force_offset=(0.0, 0.0, 1.0), axes="frd",
        force_direction=(1.0, 1.0, -1.0),
    )  # fmt: skip
    flight = read_flight(file, mapping)
    assert np.diff(flight.time).max() <= 0.11
    inner = flight.time[(flight.time > 3) & (flight.time < 36)]
    force, found = flight.at(inner)
    fine, _, rates = a_turn()
    np.testing.assert_allclose(found, interpolated(inner, fine, rates * [1, -1, -1]), atol=0.02)
    forward = GRAVITY * np.sin(0.25 * np.sin(0.3 * inner)) + np.cos(0.2 * inner)
    np.testing.assert_allclose(force[:, 0], forward, atol=0.05)
    np.testing.assert_allclose(force[:, 2], GRAVITY, rtol=1e-6)
    told = " ".join(str(one) for one in check_flight(flight))
    for words in ("rates are from the attitude", "force is from pitch and airspeed", "1 Hz"):
        assert words in told


def test_white_noise_is_taken_out_and_told_also_behind_a_lever(tmp_path):
    time, _, rates = a_turn(period=0.01, seconds=8.0)
    force = np.outer(1 + 0.3 * np.sin(0.5 * time) ** 2, [0, 0, GRAVITY])
    arm = (3.0, 0.0, 0.0)
    noisy = force + 3 * RNG.normal(size=force.shape), rates + 0.003 * RNG.normal(size=rates.shape)
    read = []
    for name, f, w in (("still", force, rates), ("noisy", *noisy)):
        signals = dict(zip("abcdef", np.hstack([f, w]).T, strict=True))
        file = written(tmp_path / f"{name}.csv", time, **signals)
        mapping = FlightColumns(force=tuple("abc"), omega=tuple("def"), lever=arm)
        read.append(read_flight(file, mapping))
    still, shaken = read
    error = shaken.specific_force - still.specific_force
    assert np.sqrt(np.mean(error**2)) < 0.35 and not still.notes
    assert np.sqrt(np.mean((shaken.angular_rate - still.angular_rate) ** 2)) < 0.001
    force, turning = (np.array(re.findall(r"\d\S*\b", one), float) for one in shaken.notes)
    np.testing.assert_allclose(force, [3, 3, 3], rtol=0.05)
    np.testing.assert_allclose(turning, 3 * [0.003], rtol=0.05)


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        (lambda t, w: w * [-1, 1, 1], "omega_direction: [-1, 1, 1]"),
        (lambda t, w: w[:, [1, 0, 2]], "omega: [omega_y, omega_x, omega_z]"),
        (lambda t, w: np.stack([np.interp(t - 0.8, t, x) for x in w.T], axis=1), "0.8 s behind"),
        (lambda t, w: w, ""),
    ],
)
def test_rates_that_contradict_the_attitude_are_told(tmp_path, change, remedy):
    time, angles, rates = a_turn()
    wrong = change(time, rates * [1, -1, -1])
    level = {"f_x": 0 * time, "f_y": 0 * time, "f_z": GRAVITY + 0 * time}
    signals = dict(zip(("omega_x", "omega_y", "omega_z"), wrong.T, strict=True))
    bank, pitch, _ = np.degrees(angles).T
    signals |= {"bank_deg": bank, "pitch_deg": pitch}
    flight = read_flight(written(tmp_path / "f.csv", time, **level, **signals))
    assert (remedy in str(check_flight(flight)[0])) if remedy else not check_flight(flight)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pull_up_with_the_nose_going_down_is_told(sign):
    time = np.arange(0, 20, 0.05)
    pull = np.sin(0.6 * time) ** 2
    force = np.outer(GRAVITY * (1 + pull), [0, 0, 1])
    flight = make_flight(time, force, np.outer(-sign * 0.15 * pull, [0, 1, 0]))
    told = [str(one) for one in check_flight(flight)]
    assert len(told) == (sign < 0) and all("[1, -1, 1]" in one for one in told)


LOGS = {
    "px4": "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_m_s2[0],"
           "accelerometer_m_s2[1],accelerometer_m_s2[2]\n{t}000000,0.1,0.2,0.3,4000,1,2,-9.8\n",
    "ardupilot": "timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\n"
                 "2026-05-01,{t}000000,0,0.1,0.2,0.3,1,2,-9.8\n",
    "xplane": "_real,_time |Gload,norml |Gload,axial |Gload,_side |____Q,rad/s |____P,rad/s |"
              "____R,rad/s |pitch,__deg |_roll,__deg |hding,_true |\n"
              "{t} |1 |0.1 |0.2 |0.2 |0.1 |0.3 |1 |2 |3 |\n",
    "fdr": "time,VRTG,LATG,LONG,PTCH,ROLL,TH\n{t},1,0.2,0.1,0,0,359\n",
    "g1000": "#airframe_info\n#yyy\nLcl Date, Lcl Time, IAS, Pitch, Roll, LatAc, NormAc, HDG\n"
             "2026-05-01, 14:00:0{t}, 100, 0, 0, 0.2, 0, 359\n",
}  # fmt: skip


@pytest.mark.parametrize("name", LOGS)
def test_shipped_mapping_reads_a_log(tmp_path, name):
    *head, row = LOGS[name].rstrip("\n").split("\n")
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*head, *(row.replace("{t}", str(t)) for t in range(1, 6))]) + "\n")
    if name in ("fdr", "g1000"):  # without columns of rates, nothing is proposed
        with pytest.raises(InputError, match=rf"shipped mapping {name} \(columns=...\) reads 4 s"):
            read_flight(path)
    flight = read_flight(path, name)
    assert flight.duration == pytest.approx(4)
    force, rate = flight.specific_force[0], flight.angular_rate[0]
    if name in ("px4", "ardupilot"):
        np.testing.assert_allclose(force, [1, -2, 9.8])
    else:
        forward = 0 if name == "g1000" else 0.1 * GRAVITY
        np.testing.assert_allclose(force, [forward, -0.2 * GRAVITY, GRAVITY], atol=1e-6)
    turning = name not in ("g1000", "fdr")
    np.testing.assert_allclose(rate, np.array([0.1, -0.2, -0.3]) * turning, atol=1e-9)


def test_attitude_that_is_not_enough_is_refused():
    with pytest.raises(InputError, match=r"attitude: .*expected bank, pitch and heading"):
        FlightColumns(omega=())
    with pytest.raises(InputError, match=r"force: .*expected columns along y and z"):
        FlightColumns(force=("a", "", "c"))
