"""Friction of sliding joints against its formula, its limits, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from sdt_drake.robot.device import Friction, friction_parameters, sliding_friction

V_S = 0.03  # rad/s
COULOMB = [300.0, 60.0, 0.0, 20.0]
VISCOUS = [40.0, 0.0, 8.0, 2.0]
BREAKAWAY = [450.0, 60.0, 10.0, 50.0]
FRICTION = Friction(COULOMB, VISCOUS, BREAKAWAY, stribeck_speed=V_S)
LOADED = dataclasses.replace(FRICTION, offset=[0.0, -70.0, 5.0, 0.0])
DRY = dataclasses.replace(FRICTION, viscous=None)


def at(friction, v):
    """Friction at the same speed of every joint, or at speeds of shape (N,): (N, 4)."""
    v = np.multiply.outer(np.asarray(v, dtype=float), np.ones(4))
    return sliding_friction(friction_parameters(friction, 4), v)


# --- the law ---------------------------------------------------------------------------------


def test_law_by_hand():
    # Joint 1 at 2 v_s: 300 + 150 * 2 exp(-3 / 2) + 40 * 0.06.
    assert at(FRICTION, 2 * V_S)[0] == pytest.approx(300 + 66.9390480 + 2.4, rel=1e-9)
    # Joint 3 at v_s / 2: 10 / 2 exp(3 / 8) + 8 * 0.015.
    assert at(FRICTION, V_S / 2)[2] == pytest.approx(7.2749571 + 0.12, rel=1e-7)
    np.testing.assert_array_equal(at(FRICTION, 0.0), 0)
    np.testing.assert_array_equal(at(FRICTION, -V_S), -at(FRICTION, V_S))
    np.testing.assert_array_equal(at(LOADED, 0.0), LOADED.offset)
    # Joint 3 at -v_s / 2, less what it carries both ways.
    assert at(LOADED, -V_S / 2)[2] == pytest.approx(5 - 7.2749571 - 0.12, rel=1e-7)


def test_peak_at_the_stribeck_speed_is_breakaway():
    v = np.linspace(0.2, 5, 4801) * V_S
    friction = at(DRY, v)
    np.testing.assert_allclose(at(DRY, V_S), BREAKAWAY, rtol=1e-12)
    np.testing.assert_allclose(friction.max(axis=0), BREAKAWAY, rtol=1e-9)
    peak = v[friction.argmax(axis=0)]
    np.testing.assert_allclose(peak[[0, 2, 3]], V_S, rtol=2e-3)
    np.testing.assert_array_equal(friction[:, 1], 60)  # breakaway is coulomb: no peak


def test_defaults_are_no_friction_and_no_peak():
    assert Friction().is_none and Friction(stribeck_speed=1.0).is_none
    for name in ("coulomb", "viscous", "breakaway", "offset"):
        assert not Friction(**{name: [0.0]}).is_none
    v = np.array([0.01, 1, 30]) * V_S
    np.testing.assert_array_equal(at(Friction(), v), 0)
    np.testing.assert_array_equal(at(Friction(coulomb=COULOMB), v), [COULOMB] * 3)
