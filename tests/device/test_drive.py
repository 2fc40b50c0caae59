"""What a drive may not be."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sdt_drake.device import Drive
from sdt_drake.errors import InputError

INTERPOLATION = 0.005  # s
GOOD = Drive(
    period=125e-6,
    torque_bandwidth=200.0,
    torque_error=[-0.99, 0.0, 0.05, 0.99],
    encoder_resolution=[2.0**20, 1e6, 4096.0, 1.0],
    n1=[200.0, 4.0, 4.0, 4.0],
    n0=[300.0, 6.0, 6.0, 4.1],
    reference_delay=0.0125,
)


def refused(message):
    return pytest.raises(InputError, match=f"^{re.escape(message)}$")


@pytest.mark.parametrize("drive", [Drive(), GOOD], ids=["ideal", "all fields"])
def test_good_drive_is_taken(drive):
    drive.validate("drive", INTERPOLATION)
    drive.validate_sizes(4, "drive")


# 5 ms / 3 is no short decimal, 0.3 ms / 3 is no whole binary multiple.
@pytest.mark.parametrize("divisor", [1, 2, 3, 5, 7, 16, 40])
@pytest.mark.parametrize("interpolation", [0.005, 0.007, 1 / 300, 0.012])
def test_whole_fraction_of_the_interpolation_period_is_taken(interpolation, divisor):
    period = interpolation / divisor
    if period >= 125e-6:
        Drive(period=period).validate("drive", interpolation)


BAD = [
    ({"period": 0.0}, "drive.period: 0.0, expected a finite number > 0"),
    ({"period": -0.005}, "drive.period: -0.005, expected a finite number > 0"),
    ({"period": np.nan}, "drive.period: nan, expected a finite number > 0"),
    ({"period": 1e-4}, "drive.period: 0.0001 s, expected at least 0.000125 s"),
    (
        {"period": 0.01},
        "drive.period: 0.01 s, expected at most the interpolation period, 0.005 s",
    ),
    (
        {"period": 0.0051},
        "drive.period: 0.0051 s, expected at most the interpolation period, 0.005 s",
    ),
    (
        {"period": 0.002},
        "drive.period: 0.002 s does not divide the interpolation period, 0.005 s",
    ),
    (
        {"period": 0.003},
        "drive.period: 0.003 s does not divide the interpolation period, 0.005 s",
    ),
    ({"torque_bandwidth": 0.0}, "drive.torque_bandwidth: 0.0, expected a finite number > 0"),
    ({"torque_bandwidth": -1.0}, "drive.torque_bandwidth: -1.0, expected a finite number > 0"),
    ({"torque_bandwidth": np.inf}, "drive.torque_bandwidth: inf, expected a finite number > 0"),
    ({"reference_delay": -1e-3}, "drive.reference_delay: -0.001, expected a finite number >= 0"),
    ({"reference_delay": np.nan}, "drive.reference_delay: nan, expected a finite number >= 0"),
    (
        {"encoder_resolution": [1e6] * 4},
        "drive.encoder_resolution: needs drive.period, to take the speed",
    ),
    ({"n1": [1.0] * 4}, "drive: n1 and n0 must be given together"),
    ({"n0": [1.0] * 4}, "drive: n1 and n0 must be given together"),
]


@pytest.mark.parametrize(("fields", "message"), BAD, ids=str)
def test_bad_drive_is_refused(fields, message):
    with refused(message):
        Drive(**fields).validate("drive", INTERPOLATION)


BAD_LISTS = [
    ({"torque_error": [0.0] * 3}, "drive.torque_error: 3 value(s), expected 4, one for each joint"),
    (
        {"torque_error": [0.0, 0.0, np.nan, 0.0]},
        "drive.torque_error: [0.0, 0.0, nan, 0.0] contains a value that is not finite",
    ),
    (
        {"torque_error": [0.1, -1.0, 0.0, 0.0]},
        "drive.torque_error: [0.1, -1.0, 0.0, 0.0], expected shares between -1 and 1",
    ),
    (
        {"torque_error": [0.0, 0.0, 0.0, 1.5]},
        "drive.torque_error: [0.0, 0.0, 0.0, 1.5], expected shares between -1 and 1",
    ),
    (
        {"encoder_resolution": [1e6, 1e6, 1e6, 0.5]},
        "drive.encoder_resolution: [1000000.0, 1000000.0, 1000000.0, 0.5], expected at least 1",
    ),
    (
        {"encoder_resolution": [1e6] * 5},
        "drive.encoder_resolution: 5 value(s), expected 4, one for each joint",
    ),
    (
        {"encoder_resolution": [1e6, 0.0, 1e6, 1e6]},
        "drive.encoder_resolution: [1000000.0, 0.0, 1000000.0, 1000000.0], every value must be > 0",
    ),
    (
        {"n1": [1.0, 1.0, 1.0, 0.0], "n0": [2.0] * 4},
        "drive.n1: [1.0, 1.0, 1.0, 0.0], every value must be > 0",
    ),
    ({"n1": [1.0] * 4, "n0": [2.0] * 3}, "drive.n0: 3 value(s), expected 4, one for each joint"),
    (
        {"n1": [1.0] * 4, "n0": [2.0, 2.0, 2.0, np.inf]},
        "drive.n0: [2.0, 2.0, 2.0, inf] contains a value that is not finite",
    ),
    (
        {"n1": [1.0, 2.0, 3.0, 4.0], "n0": [2.0, 3.0, 3.0, 5.0]},
        "drive.n0: [2.0, 3.0, 3.0, 5.0], expected more than n1, [1.0, 2.0, 3.0, 4.0], everywhere",
    ),
    (
        {"n1": [3.0] * 4, "n0": [2.0] * 4},
        "drive.n0: [2.0, 2.0, 2.0, 2.0], expected more than n1, [3.0, 3.0, 3.0, 3.0], everywhere",
    ),
]


@pytest.mark.parametrize(("fields", "message"), BAD_LISTS, ids=str)
def test_bad_list_is_refused(fields, message):
    with refused(message):
        Drive(**fields).validate_sizes(4, "drive")
