"""The catalogue of motors: what is published, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.motors import load_catalogue

MOTOR = """
  - {id: M1, kind: torque motor, peak_torque: 100, rated_torque: 40, rotor_inertia: 0.1,
     n1_rpm: 60, n0_rpm: 120, mass: 10, thermal_time_constant: 180, source: illustrative}
"""


def test_rpm_become_rad_per_s(tmp_path):
    (tmp_path / "motors.yaml").write_text("motors:" + MOTOR)
    (motor,) = load_catalogue(tmp_path / "motors.yaml").motors
    assert (motor.n1, motor.n0) == pytest.approx((2 * np.pi, 4 * np.pi), rel=1e-15)
    assert motor.gear_ratio == 1


BAD = [
    ("n0_rpm: 120", "n0_rpm: 60", "motors[1].n0_rpm: 60, expected more than n1_rpm, 60"),
    ("mass: 10", "gear_ratio: 2, mass: 10", "motors[1].gear_ratio: 2, but a torque motor dri"),
    (MOTOR, MOTOR + MOTOR, "motors[2].id: 'M1' is given twice"),
]  # fmt: skip


@pytest.mark.parametrize("old, new, message", BAD, ids=[case[-1] for case in BAD])
def test_a_bad_motor_is_refused_with_file_and_field(tmp_path, old, new, message):
    path = tmp_path / "motors.yaml"
    path.write_text("motors:" + MOTOR.replace(old, new))
    with pytest.raises(InputError) as error:
        load_catalogue(path)
    (line,) = error.value.lines
    assert line.startswith(f"{path}: {message}")
