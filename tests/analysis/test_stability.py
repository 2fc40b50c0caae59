"""Stability with elastic joints, against maps by hand."""

import numpy as np
import pytest
from helpers.modes import moving
from helpers.variants import kind
from oracles.by_hand import ROTORS
from oracles.two_mass import cascade_map, two_masses
from scipy.optimize import brentq

import sdt_drake as sdt
from sdt_drake.analysis.stability import stability_sweep
from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Drive

ZETA = np.array([0.95, 0.98, 0.99, 0.95])
OMEGA_R = 65.991
SOME = np.array([0.1, 0.3, 0.5, 0.7, 1.0, 1.5])


@pytest.fixture(scope="module")
def design(designed):
    return designed("coupled_pi")


POSITION_GAIN = [3.0, 5.0, 7.0, 20.0]
ERRORS = [0.1, -0.1, 0, 0.2]


@pytest.mark.parametrize(
    ("fields", "encoder", "drive", "damping_ratio"),
    [
        (kind("pi"), "motor", Drive(), 0.2),
        (kind("pi"), "link", Drive(period=0.005, torque_error=ERRORS), 0.01),
        (kind("p_pi", position_gain=POSITION_GAIN), "motor", Drive(period=0.001), 0.01),
        (kind("p_pi"), "link", Drive(), 0.01),
    ],
)
def test_elastic_modes_and_overshoot_equal_map_by_hand(
    designed, fields, encoder, drive, damping_ratio
):
    """K_V follows omega_n, or is the scenario's own; positions are sampled every 5 ms."""
    design = designed("coupled_pi", fields)
    sweep = stability_sweep(
        design, OMEGA_R, encoder=encoder, drive=drive, ratios=SOME, damping_ratio=damping_ratio
    )
    is_cascade = design.scenario.controller.kind == "p_pi"
    period = 0.005 if is_cascade else drive.period or 0.001
    for k, inertia in enumerate(design.inertia.maximum):

        def over_a_period(ratio, k=k, inertia=inertia):
            """Map of the closed loop at v_ref = 0, and what a speed that is asked for adds."""
            omega_n, gain = ratio * OMEGA_R, inertia * (1 + (drive.torque_error or [0] * 4)[k])
            k_v = is_cascade * (fields.get("controller.position_gain") or [omega_n / 4] * 4)[k]
            gains = np.array([[[2 * ZETA[k] * omega_n * gain]], [[omega_n**2 * gain]]])
            at = 2 if encoder == "motor" else 0
            masses = two_masses(ROTORS[k], inertia - ROTORS[k], OMEGA_R, damping_ratio)
            A, B = cascade_map(*masses, np.eye(4)[[at + 1]], gains, period, drive.period)
            return A - k_v * B * np.eye(5)[at], B[:, 0], k_v

        def damping_at(ratio, over_a_period=over_a_period):
            z = moving(np.linalg.eigvals(over_a_period(ratio)[0]).astype(complex), 1e-12)
            modes = moving(np.log(z) / period)
            return np.min(-modes.real / np.abs(modes))

        expected = [damping_at(ratio) for ratio in SOME]
        np.testing.assert_allclose(sweep.damping[:, k], expected, atol=1e-6)
        unstable, border = np.flatnonzero(np.array(expected) < 0), np.inf
        if len(unstable):
            border = brentq(damping_at, [1e-6, *SOME][unstable[0]], SOME[unstable[0]])
        assert sweep.unstable_from[k] == pytest.approx(border, abs=1e-3)
        for i, ratio in enumerate(SOME if is_cascade else ()):
            if sweep.damping[i, k] > 0:
                (A, B, k_v), x, speeds = over_a_period(ratio), np.zeros(5), []
                for j in range(2000):
                    speeds.append(x[1])
                    x = A @ x + B * (1 + k_v * period * j)
                overshoot = 100 * (max(speeds) - 1)
                assert sweep.overshoot_percent[i, k] == pytest.approx(overshoot, abs=0.1)
    np.testing.assert_array_equal(np.isnan(sweep.overshoot_percent), sweep.damping <= 0)


@pytest.mark.parametrize(("controller", "overshoot"), [("pi_id", 37), ("pi_scheduled", None)])
def test_other_speed_controllers_have_modes_of_pi(designed, design, controller, overshoot):
    """pi_id has both gains on the error, hence a zero; pi_scheduled its largest gains, as pi."""
    sweep = stability_sweep(designed("coupled_pi", kind(controller)), OMEGA_R, ratios=SOME)
    plain = stability_sweep(design, OMEGA_R, ratios=SOME)
    np.testing.assert_allclose(sweep.damping, plain.damping, rtol=1e-9)
    expected = plain.overshoot_percent[2] if overshoot is None else [overshoot] * 4  # at 0.5
    np.testing.assert_allclose(sweep.overshoot_percent[2], expected, atol=0.5)


@pytest.mark.oracle
def test_stability_sweeps_both_encoders_with_ideal_and_own_drive(designed):
    sampled = Drive(period=0.005)
    found = sdt.stability(designed("axis_pi", {"drive": sampled}), omega_r=OMEGA_R, damping=0.02)
    drives = {"ideal drive": Drive(), "the scenario's drive": sampled}
    swept = [(encoder, list(by)) for encoder, by in found.sweeps.items()]
    assert swept == [("motor", list(drives)), ("link", list(drives))]
    one = stability_sweep(
        found.design, OMEGA_R, encoder="link", drive=sampled, ratios=SOME, damping_ratio=0.02
    )
    kept = found.sweeps["link"]["the scenario's drive"]
    rows = [int(np.abs(kept.ratio - ratio).argmin()) for ratio in SOME]
    np.testing.assert_array_equal(kept.damping[rows], one.damping)
    with pytest.raises(InputError, match=r"^omega_r: missing, expected"):
        sdt.stability(designed("axis_pi"))
