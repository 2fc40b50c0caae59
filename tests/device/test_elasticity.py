"""Springs of elastic joints against their formula, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sdt_drake.device import ENCODERS, Elasticity, springs_of
from sdt_drake.errors import InputError

OMEGA = [60.0, 0.0, 150.0, 30.0]  # rad/s
INERTIA = np.array([18000.0, 90.0, 790.0, 250.0])  # kg m²
GRAVITY = np.array([0.0, 500.0, 900.0, -300.0])  # N m/rad
WHERE = "plant.elasticity"


def refused(message):
    return pytest.raises(InputError, match=f"^{re.escape(message)}$")


# --- springs ---------------------------------------------------------------------------------


def test_springs_by_hand():
    springs = springs_of(Elasticity(OMEGA, damping_ratio=0.05), INERTIA, GRAVITY)
    np.testing.assert_array_equal(springs.elastic, [True, False, True, True])
    # 60² 18000; -; 150² 790 - 900; 30² 250 + 300
    np.testing.assert_allclose(springs.stiffness, [64.8e6, 0, 17_774_100, 225_300], rtol=1e-14)
    # 2 * 0.05 omega d
    np.testing.assert_allclose(springs.damping, [108_000, 0, 11_850, 750], rtol=1e-14)


def test_spring_and_gravity_swing_the_link_at_the_given_frequency():
    """d x'' + c x' + (k + k_g) x = 0 has the roots of omega and zeta."""
    springs = springs_of(Elasticity(OMEGA, damping_ratio=0.2), INERTIA, GRAVITY)
    for k in (0, 2, 3):
        stiffness = springs.stiffness[k] + GRAVITY[k]
        roots = np.roots([INERTIA[k], springs.damping[k], stiffness])
        np.testing.assert_allclose(np.abs(roots), OMEGA[k], rtol=1e-12)
        np.testing.assert_allclose(-roots.real / np.abs(roots), 0.2, rtol=1e-12)


def test_a_little_damping_and_the_motor_encoder_by_default():
    elasticity = Elasticity(OMEGA)
    assert (elasticity.damping_ratio, elasticity.encoder) == (0.01, "motor")
    springs = springs_of(elasticity, INERTIA, GRAVITY)
    np.testing.assert_allclose(springs.damping, 0.02 * INERTIA * OMEGA, rtol=1e-14)


@pytest.mark.parametrize("k_g", [900.0 * 790, 900.0 * 791])
def test_link_that_gravity_alone_swings_faster_is_refused(k_g):
    with refused(
        "plant.elasticity.natural_frequency: 30 rad/s, but gravity alone makes joint 3 swing "
        f"with {np.sqrt(k_g / 790):.4g}; expected more"
    ):
        springs_of(Elasticity([0.0, 0.0, 30.0, 0.0]), INERTIA, [0, 0, k_g, 0])


def test_frequency_too_large_for_a_number_is_refused():
    with refused(
        "plant.elasticity: natural_frequency 1e+200 rad/s and damping_ratio 0.01 are too large "
        "for joint 2"
    ):
        springs_of(Elasticity([0.0, 1e200, 0.0, 0.0]), INERTIA, GRAVITY)


# --- data ------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("omega", [OMEGA, [0.0, 0.0, 0.0, 1.0], [9.0] * 4])
def test_good_elasticity_is_taken(omega, encoder):
    elasticity = Elasticity(omega, damping_ratio=0.0, encoder=encoder)
    elasticity.validate(WHERE)
    elasticity.validate_sizes(4, WHERE)


def test_encoders_of_motor_and_link():
    assert set(ENCODERS) == {"motor", "link"}


BAD = [
    ({"damping_ratio": -0.01}, "damping_ratio: -0.01, expected a finite number >= 0"),
    ({"damping_ratio": np.nan}, "damping_ratio: nan, expected a finite number >= 0"),
    ({"damping_ratio": np.inf}, "damping_ratio: inf, expected a finite number >= 0"),
    ({"encoder": "gear"}, "encoder: 'gear', expected one of motor, link"),
]


@pytest.mark.parametrize(("fields", "message"), BAD, ids=str)
def test_bad_field_is_refused(fields, message):
    with refused(f"{WHERE}.{message}"):
        Elasticity(OMEGA, **fields).validate(WHERE)


BAD_LISTS = [
    ([], ".natural_frequency: 0 value(s), expected 4, one for each joint"),
    ([1.0] * 3, ".natural_frequency: 3 value(s), expected 4, one for each joint"),
    ([1.0, -2.0, 0.0, 0.0], ".natural_frequency: [1.0, -2.0, 0.0, 0.0] contains a value < 0"),
    (
        [1.0, np.nan, 0.0, 0.0],
        ".natural_frequency: [1.0, nan, 0.0, 0.0] contains a value that is not finite",
    ),
    ([0.0] * 4, f".natural_frequency: all joints are rigid; remove {WHERE}"),
]


@pytest.mark.parametrize(("omega", "message"), BAD_LISTS, ids=str)
def test_bad_frequencies_are_refused(omega, message):
    with refused(WHERE + message):
        Elasticity(omega).validate_sizes(4, WHERE)
