"""Recordings of flights: columns, units, axes, levers, and suspicions."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from helpers.strategies import GENERATORS
from hypothesis import given
from hypothesis import strategies as st

from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.flight import FlightColumns, make_flight, read_flight
from sdt_drake.machine.diagnose.flight import check_flight
from sdt_drake.pilot.head import GRAVITY

FORCES, RATES = {"m/s2": 1.0, "g": GRAVITY, "ft/s2": 0.3048}, {"rad/s": 1.0, "deg/s": np.pi / 180}


@st.composite
def mappings(draw) -> FlightColumns:
    rng = draw(GENERATORS)
    return FlightColumns(
        force=list("abc"), omega=list("def"), axes=draw(st.sampled_from(["flu", "frd"])),
        force_factor=draw(st.floats(1e-3, 1e3)),
        omega_factor=draw(st.floats(1e-3, 1e3)),
        force_unit=draw(st.sampled_from(list(FORCES))),
        omega_unit=draw(st.sampled_from(list(RATES))),
        force_direction=rng.choice([-1.0, 1.0], 3).tolist(),
        omega_direction=rng.choice([-1.0, 1.0], 3).tolist(),
        lever=(draw(st.sampled_from([0.0, 1.0])) * rng.normal(size=3)).tolist(),
    )  # fmt: skip


@given(mappings(), GENERATORS)
def test_flight_is_the_same_in_any_units_axes_and_lever(tmp_path_factory, m, rng):
    time, alpha = 0.01 * np.arange(50), rng.normal(size=3)
    omega = rng.normal(size=3) + alpha * time[:, None]  # straight: its differences are exact
    force = rng.normal(size=3) + rng.normal(size=3) * time[:, None]
    sensor = force + np.cross(alpha, m.lever) + np.cross(omega, np.cross(omega, m.lever))
    down = np.array([1, 1, 1] if m.axes == "flu" else [1, -1, -1])
    values = np.column_stack([
        time + 7, sensor * down * m.force_direction / FORCES[m.force_unit] / m.force_factor,
        omega * down * m.omega_direction / RATES[m.omega_unit] / m.omega_factor,
    ])  # fmt: skip
    path = tmp_path_factory.mktemp("f") / "flight.csv"
    rows = [",".join(map(repr, row)) for row in values.tolist()]
    path.write_text("\n".join(["time,a,b,c,d,e,f", *rows]) + "\n")
    flight = read_flight(path, m)
    np.testing.assert_allclose(flight.specific_force, force, atol=1e-9)
    np.testing.assert_allclose(flight.angular_rate, omega, atol=1e-9)
    np.testing.assert_allclose(flight.time, time, atol=1e-12)
    with pytest.raises(InputError, match=r"no column 'f_x' \(force\), there are time, a"):
        read_flight(path)


@pytest.mark.parametrize(
    ("force", "rate", "kind", "words", "remedy"),
    [
        (lambda f: f / GRAVITY, lambda w: w, "unit", "is it in g?", "force_unit: g"),
        (lambda f: f / 0.3048, lambda w: w, "unit", "is it in ft/s²?", "force_unit: ft/s2"),
        (lambda f: f - [0, 0, GRAVITY], lambda w: w, "unit", "was gravity subtracted", ""),
        (lambda f: f[:, [2, 0, 1]], lambda w: w, "columns", "another order", ""),
        (lambda f: f * [1, 1, -1], lambda w: w, "columns", "is z down", "axes: frd"),
        (lambda f: f, np.degrees, "unit", "is it in degrees", "omega_unit: deg/s"),
    ],
)
def test_wrong_unit_or_axis_of_flight_is_named(force, rate, kind, words, remedy):
    flight = read_flight("turn")
    assert check_flight(flight) == []
    wrong = make_flight(flight.time, force(flight.specific_force), rate(flight.angular_rate))
    (found,) = check_flight(wrong)
    assert (found.kind, found.remedy, found.source) == (kind, remedy, "flight")
    assert words in found.sentence


def turn():
    flight = read_flight("turn")
    return flight.time, flight.specific_force, flight.angular_rate


def columns_of(text, columns, mark=","):
    """A file with columns of numbers below a header."""
    rows = np.column_stack(columns).tolist()
    return "\n".join([text, *(mark.join(map(repr, row)) for row in rows)]) + "\n"


FRD, LOAD = np.array([1, -1, -1]), np.array([1, -1, 1])  # load factors are positive upwards
T, F, W = turn()
US, SECONDS = np.round(1e6 * T), np.floor(T + 0.3) + 1.7e9
XYZ = "accelerometer_{}", "gyro_{}"

LOGS = {
    "JSBSim": columns_of("Time,a-x-ft_sec2,a-y-ft_sec2,a-z-ft_sec2,p-rad_sec,q-rad_sec,r-rad_sec",
                         [T, F * FRD / 0.3048, W * FRD]),
    "PX4": columns_of("timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],accelerometer_m_s2[0],"
                      "accelerometer_m_s2[1],accelerometer_m_s2[2]", [US + 7, W * FRD, F * FRD]),
    "MAVLink": columns_of("time_usec,xacc,yacc,zacc,xgyro,ygyro,zgyro,xmag,ymag,zmag",
                          [US, F * FRD / GRAVITY * 1000, W * FRD, F]),
    "Betaflight": columns_of("loopIteration,time,gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],"
                             "accSmooth[1],accSmooth[2]",
                             [np.arange(len(T)), US, np.degrees(W), F / GRAVITY * 2048]),
    "ROS": columns_of("header.stamp.secs,header.stamp.nsecs,angular_velocity.x,angular_velocity.y,"
                      "angular_velocity.z,linear_acceleration.x,linear_acceleration.y,"
                      "linear_acceleration.z",
                      [SECONDS, np.round((T + 0.3) % 1 * 1e9), W, F]),
    "X-Plane": columns_of("   _real,_time |    ____P,rad/s |    ____Q,rad/s |    ____R,rad/s |"
                          "    Gload,axial |    Gload,_side |    Gload,norml ",
                          [T, W * FRD, F * LOAD / GRAVITY], "|"),
    "a recorder": columns_of("t,NX,NY,NZ,roll_rate,pitch_rate,yaw_rate,roll,pitch,yaw",
                             [T, F * LOAD / GRAVITY, np.degrees(W) * FRD, W]),
    "a German one": columns_of("Zeit;Beschl_x [g];Beschl_y [g];Beschl_z [g];Drehrate_x [°/s];"
                               "Drehrate_y [°/s];Drehrate_z [°/s]",
                               [T, F / GRAVITY, np.degrees(W)], ";").replace(".", ","),
    "a row of units": columns_of("t,ax,ay,az,gx,gy,gz\ns,g,g,g,deg/s,deg/s,deg/s",
                                 [T, F / GRAVITY, np.degrees(W)]),
}  # fmt: skip


@pytest.mark.parametrize("kind", LOGS)
def test_what_is_proposed_for_the_log_of_a_flight_reads_it(tmp_path, kind):
    """By the header alone; units, signs and axes by what the flight would be."""
    path = tmp_path / "log.csv"
    path.write_text(LOGS[kind])
    with pytest.raises(InputError) as error:
        read_flight(path)
    told, _, mapping = str(error.value).partition("as a mapping file (columns=...): ")
    assert "740 rows, 73.9 s at 10 Hz, median force 1.08 G, mean along z 1.31 G, rates up" in told
    flight = read_flight(path, FlightColumns(**yaml.safe_load(mapping)))
    np.testing.assert_allclose(flight.time, T, atol=2e-6)
    np.testing.assert_allclose(flight.specific_force, F, atol=1e-9)
    np.testing.assert_allclose(flight.angular_rate, W, atol=1e-9)
    assert check_flight(flight) == []


def test_flight_at_1_hz_is_not_taken_for_one_in_milliseconds(tmp_path):
    path = tmp_path / "slow.csv"
    path.write_text(columns_of("t,ax,ay,az,p,q,r", [T[::10], F[::10] * FRD, W[::10] * FRD]))
    with pytest.raises(InputError, match="731 rows, 73 s at 10 Hz") as error:
        read_flight(path)
    assert "milli" not in str(error.value)


Z_DOWN = {"axes": "frd"}
HINTS = [  # wrong fields of the mapping, the raw force, and what is to be written
    ({"force_unit": "g"}, F * FRD, "is it in m/s²?", "force_unit: m/s2"),
    ({"force_unit": "ft/s2"}, F * FRD, "is it in m/s²?", "force_unit: m/s2"),
    ({}, F * FRD / 0.3048, "is it in ft/s²?", "force_unit: ft/s2"),
    ({"force_unit": "g"}, F * FRD / 0.3048, "is it in ft/s²?", "force_unit: ft/s2"),
    ({"force_unit": "g"}, F * FRD / GRAVITY * 1e3, "is it in thousandths", "force_factor: 0.001"),
    ({"force_unit": "g", "force_factor": 1e-3}, F * FRD / GRAVITY, "in g?", "force_factor: 1.0"),
    ({"force_direction": [1, 1, -1]}, F * FRD, "other sign", "force_direction: [1, 1, 1]"),
    ({}, F * LOAD, "has the column 'c' the other sign", "force_direction: [1, 1, -1]"),
    ({"axes": "flu"}, F * FRD, "is z down? Then it is 1.31 G upwards", "axes: frd"),
    ({"force_unit": "g"}, 7e9 * F * FRD, "in which unit is it? force_factor: 1.", ""),
]  # fmt: skip


@pytest.mark.parametrize("wrong, force, words, remedy", HINTS)
def test_hint_corrects_the_mapping_and_names_nothing_that_is_set(
    tmp_path, wrong, force, words, remedy
):
    path = tmp_path / "flight.csv"
    path.write_text(columns_of("time,a,b,c,d,e,f", [T, force, W * FRD]))
    columns = FlightColumns(**{"force": list("abc"), "omega": list("def"), **Z_DOWN, **wrong})
    (found,) = check_flight(read_flight(path, columns))
    assert words in found.sentence and found.remedy == remedy
    if remedy:
        better = replace(columns, **yaml.safe_load(f"{{{remedy}}}"))
        assert check_flight(read_flight(path, better)) == []


@pytest.mark.parametrize(("entry", "is_asked"), [(1.1, False), (3.8, True), (0.3, True)])
def test_unit_of_a_long_pull_is_asked_only_if_no_part_is_level(entry, is_asked):
    size = np.where(np.arange(len(T)) < 0.15 * len(T), entry, 3.8) * GRAVITY
    flight = make_flight(T, np.outer(size, [0, 0, 1]), 0 * F, "pull")
    assert [x.kind.startswith("unit") for x in check_flight(flight)] == [True] * is_asked


def test_rate_that_is_in_degrees_already_is_not_asked_for_degrees(tmp_path):
    path = tmp_path / "flight.csv"
    path.write_text(columns_of("time,a,b,c,d,e,f", [T, F, 16.4 * np.degrees(W) * 9]))
    columns = FlightColumns(force=list("abc"), omega=list("def"), omega_unit="deg/s")
    (found,) = check_flight(read_flight(path, columns))
    assert "in which unit is it? omega_factor" in found.sentence and not found.remedy


def test_moving_means_keep_the_integral():
    flight = read_flight("turn")
    force, _ = flight.means(0.2 * np.arange(-20, 420), 0.2)
    np.testing.assert_allclose(force[0], flight.specific_force[0], rtol=1e-9)
    np.testing.assert_allclose(force[-1], flight.specific_force[-1], rtol=1e-9)
    whole = np.trapezoid(flight.specific_force, flight.time, axis=0)
    inside = 0.2 * force[20:391].sum(axis=0) - 0.1 * (force[20] + force[390])
    np.testing.assert_allclose(inside, whole, rtol=2e-3)


NO_FLIGHT = [
    ([0.0, 0.1, 0.1], 3, "time: expected at least 2 samples, each later than the one before"),
    ([0.0], 3, "time: expected at least 2 samples"),
    ([0.0, 0.1, 5.0], 3, "time: 4.9 s between samples at 0.1 s, expected at most"),
    (np.linspace(0, 3700, 9000), 3, "time: 3700 s, expected at most 3600 s"),
    ([0.0, 0.1], 2, "specific_force: shape (2, 2), expected (2, 3)"),
]


@pytest.mark.parametrize("time, axes, message", NO_FLIGHT, ids=[case[-1] for case in NO_FLIGHT])
def test_arrays_that_are_no_flight_are_refused(time, axes, message):
    values = np.ones((len(time), axes))
    with pytest.raises(InputError, match="^" + re.escape(message)):
        make_flight(np.array(time), values, values)
