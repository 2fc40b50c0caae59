"""Recordings of flights: columns, units, axes, levers, and what looks wrong in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import find_file
from sdt_drake.machine.fly.flight import (
    FlightColumns,
    load_flight_columns,
    make_flight,
    read_flight,
    suspicious_flight,
)
from sdt_drake.robot.head import GRAVITY

N = 40


@pytest.fixture
def turning():
    """Time, force and rate of a head in a gentle roll, 10 Hz."""
    time = 0.1 * np.arange(N)
    rng = np.random.default_rng(4)
    return time, [0.5, 0.2, 9.8] + 0.3 * rng.normal(size=(N, 3)), 0.1 * rng.normal(size=(N, 3))


def write(folder, names, *columns):
    path = folder / "flight.csv"
    text = ",".join(names) + "\n"
    text += "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    path.write_text(text + "\n")
    return path


def same(flight, force, rate):
    np.testing.assert_allclose(flight.specific_force, force, atol=1e-9)
    np.testing.assert_allclose(flight.angular_rate, rate, atol=1e-12)


def test_own_columns_need_no_mapping(tmp_path, turning):
    time, force, rate = turning
    names = ["time", "f_x", "f_y", "f_z", "omega_x", "omega_y", "omega_z"]
    flight = read_flight(write(tmp_path, names, time + 7, force, rate))
    same(flight, force, rate)
    np.testing.assert_allclose(flight.time, time, atol=1e-12)
    assert flight.attitude is None


def test_jsbsim_counts_right_and_down_in_feet(tmp_path, turning):
    time, force, rate = turning
    columns = load_flight_columns("jsbsim")
    names = [columns.time, *columns.force, *columns.omega]
    down = [1, -1, -1]
    path = write(tmp_path, names, time, force * down / 0.3048, rate * down)
    same(read_flight(path, "jsbsim"), force, rate)


def test_recorders_have_load_factors_and_degrees(tmp_path, turning):
    time, force, rate = turning
    columns = replace(load_flight_columns("recorder"), lever=[0, 0, 0])
    names = [columns.time, *columns.force, *columns.omega]
    path = write(
        tmp_path, names, time, force * [1, -1, 1] / GRAVITY, np.degrees(rate * [1, -1, -1])
    )
    same(read_flight(path, columns), force, rate)


def test_a_lever_takes_off_what_rotation_does_at_the_sensor(tmp_path):
    time, lever = 0.01 * np.arange(300), np.array([1.5, -0.4, 0.3])
    omega = np.stack([0.5 * time, 1.0 - 0.2 * time, 0 * time], axis=1)  # straight: exact
    alpha = np.tile([0.5, -0.2, 0.0], (len(time), 1))
    head = np.tile([0.3, 0.1, 9.7], (len(time), 1))
    shown = head + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
    names = ["time", "f_x", "f_y", "f_z", "omega_x", "omega_y", "omega_z"]
    path = write(tmp_path, names, time, shown, omega)
    same(read_flight(path, FlightColumns(lever=list(lever))), head, omega)


def test_a_missing_column_is_told_with_those_there(tmp_path, turning):
    time, force, rate = turning
    path = write(tmp_path, ["time", "ax", "ay", "az", "p", "q", "r"], time, force, rate)
    with pytest.raises(InputError, match=r"no column 'f_x' \(force\), there are time, ax, ay"):
        read_flight(path)


def test_the_shipped_flight_looks_right():
    flight = read_flight("turn")
    assert flight.duration == pytest.approx(73.9)
    assert flight.attitude is not None
    assert list(suspicious_flight(flight)) == []


@pytest.mark.parametrize(
    ("force", "rate", "told"),
    [
        (lambda f: f / GRAVITY, lambda w: w, "in g"),
        (lambda f: f - [0, 0, GRAVITY], lambda w: w, "was gravity subtracted"),
        (lambda f: f[:, [2, 0, 1]], lambda w: w, "another order"),
        (lambda f: f * [1, 1, -1], lambda w: w, "is z down"),
        (lambda f: f / 0.3048, lambda w: w, "in ft/s²"),
        (lambda f: f, np.degrees, "in degrees"),
    ],
)
def test_what_looks_wrong_is_told(force, rate, told):
    flight = read_flight("turn")
    wrong = make_flight(flight.time, force(flight.specific_force), rate(flight.angular_rate))
    (line,) = suspicious_flight(wrong)
    assert told in line


def test_a_last_line_that_was_cut_off_is_told(tmp_path):
    text = find_file("turn", "flight").read_text(encoding="utf-8").rstrip("\n")
    cut = tmp_path / "cut.csv"
    cut.write_text(text[: text.rindex("\n") + 12], encoding="utf-8")
    flight = read_flight(cut)
    assert len(flight.time) == len(read_flight("turn").time) - 1
    (line,) = suspicious_flight(flight)
    assert line.startswith("cut: the last line is incomplete and was ignored: ")


def test_means_around_a_time_keep_the_integral():
    flight = read_flight("turn")
    force, _ = flight.means(0.2 * np.arange(-20, 420), 0.2)
    np.testing.assert_allclose(force[0], flight.specific_force[0], rtol=1e-9)
    np.testing.assert_allclose(force[-1], flight.specific_force[-1], rtol=1e-9)
    whole = np.trapezoid(flight.specific_force, flight.time, axis=0)
    inside = 0.2 * force[20:391].sum(axis=0) - 0.1 * (force[20] + force[390])
    np.testing.assert_allclose(inside, whole, rtol=2e-3)


@pytest.mark.parametrize(
    ("time", "told"),
    [
        ([0.0, 0.1, 0.1], "each later than the one before"),
        ([0.0, 0.1, 5.0], "4.9 s between samples at 0.1 s"),
        ([0.0, 0.1], r"shape \(3, 3\), expected \(2, 3\)"),
    ],
)
def test_arrays_that_are_no_flight_are_refused(time, told):
    with pytest.raises(InputError, match=told):
        make_flight(time, np.ones((3, 3)), np.ones((3, 3)))
