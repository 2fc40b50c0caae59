"""Recordings of flights: columns, units, axes, levers, and suspicions."""

import re

import numpy as np
import pytest
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
    force = rng.normal(size=(50, 3))
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
