"""PI with a disturbance observer: its law in the closed loop, and a run that starts at rest."""

import numpy as np
import pytest
from helpers.variants import weaker

from sdt_drake.analysis.linear import linearise
from sdt_drake.run.simulate import simulate


def test_an_observer_multiplies_the_response_to_a_load_by_s_over_s_plus_g(designed):
    """With the exact inertia: I_eff r dv/dt = PI - (1 - Q) load, Q = g / (s + g)."""
    g = np.array([10.0, 20.0, 40.0, 80.0])
    fields = {"controller.kind": "pi_dob", "controller.observer_bandwidth": g}
    omega = np.geomspace(0.1, 1000, 30)
    by_load = []
    for changes in (fields, {}):
        exact = {"plant.i_eff": designed("axis_pi", end=0.1).tuning.inertia.maximum}
        design = designed("axis_pi", changes | exact, end=0.1)
        response = linearise(design, 0, at_rest=True).whole().response(omega)
        by_load.append(np.einsum("ikk->ik", response[:, 12:16, 12:16]))
    s = 1j * omega[:, None]
    np.testing.assert_allclose(by_load[0], s / (s + g) * by_load[1], rtol=1e-6)


@pytest.mark.parametrize("fields", [{}, {"drive.period": 0.001}, {"controller.anti_windup": True}])
def test_a_run_with_an_observer_starts_in_equilibrium(designed, fields):
    fields = fields | {"controller.kind": "pi_dob"}
    design = designed("coupled_pi", fields, end=0.1, rest=20)
    run = simulate(design, probes=["disturbance_observer.disturbance"])
    np.testing.assert_allclose(run.tau[:21], run.tau[[0] * 21], rtol=1e-6, atol=1e-6)
    found = run.probes["disturbance_observer.disturbance"]
    np.testing.assert_allclose(found[:21], run.tau[:21], rtol=1e-6, atol=1e-6)


def test_what_the_saturation_cuts_is_no_disturbance(designed):
    """A motor with a tenth of its torque saturates; the estimate is what it moves, no more."""
    fields = {"controller.kind": "pi_dob", "disturbance.amplitude": 0.0}
    design = weaker(designed("coupled_pi", fields, start=1.0, end=2.0), 0.1)
    run = simulate(design, probes=["disturbance_observer.disturbance"])
    limit, r = design.device.simulated.motor_torque_limit, design.nominal.gear_ratio
    inertia, g = design.tuning.inertia.maximum, design.tuning.omega_n
    assert run.saturated.max() == 1
    z = run.probes["disturbance_observer.disturbance"] + g * inertia * r * run.v
    acting = run.tau + g * inertia * r * run.v  # z follows it with the time constant 1 / g
    bound = np.abs(acting).max(axis=0) + np.abs(z[0])
    assert np.all(np.abs(z) <= bound) and np.all(np.abs(run.tau) <= limit * (1 + 1e-9))


@pytest.mark.documents
def test_numbers_of_the_findings_on_the_observer(designed):
    """With the right model; the rows of the table are compared with all other controllers."""
    twice = 2 * designed("coupled_pi").tuning.omega_n
    for option, value, position, rms in (
        ("observer_bandwidth", twice, 5.365, 0.05729),
        ("setpoint_weight", 1.0, 0.416, 0.00552),
    ):
        fields = {"controller.kind": "pi_dob", f"controller.{option}": value}
        run = simulate(designed("coupled_pi", fields))
        assert np.degrees(np.abs(run.position_error[:, 1]).max()) == pytest.approx(
            position, abs=6e-4
        )
        error = run.speed_error[:, 1]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(rms, abs=6e-6)
