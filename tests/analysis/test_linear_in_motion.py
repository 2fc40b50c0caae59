"""Linear models of a loop that turns: by finite differences, by hand, and their poles and zeros."""

import numpy as np
import pytest
from helpers.variants import kind

from sdt_drake.analysis.frequency_response import bode, frequency_response
from sdt_drake.analysis.linear import linear, linear_process, linearise, operating_point
from sdt_drake.cli.app import main
from sdt_drake.run.loop import make_loop

TURNING = (1700, 2500)  # the arm turns at 2.4 rad/s, the roll at 1.5 rad/s or back


def by_differences(design, q, v):
    """Change of all rates of the simulated loop with its states, in steady motion at q and v."""
    loop = make_loop(design)
    context = loop.diagram.CreateDefaultContext()
    loop.set_steady_state(context, q, v)
    start = context.get_continuous_state_vector().CopyToVector()

    def rates(state):
        context.SetContinuousState(state)
        return loop.diagram.EvalTimeDerivatives(context).CopyToVector().copy()

    steps = 1e-6 * np.eye(len(start))
    return np.transpose([(rates(start + h) - rates(start - h)) / 2e-6 for h in steps])


LAGGING = {
    "plant.elasticity": {"natural_frequency": [60.0, 80.0, 0.0, 90.0], "encoder": "link"},
    "plant.friction.viscous": [300.0, 40.0, 40.0, 20.0],
    "drive.torque_bandwidth": 100.0,
    "drive.torque_error": [0.05, -0.02, 0.01, 0.0],
}


@pytest.mark.parametrize("at_rest", [False, True])
@pytest.mark.parametrize("sample", TURNING)
@pytest.mark.parametrize("fields", [{}, LAGGING])
def test_a_linear_loop_has_the_modes_of_differences_of_the_simulated_one(
    designed, fields, sample, at_rest
):
    design = designed("coupled_pi", fields)
    motion = design.reference.tracked
    A = by_differences(design, motion.q[sample], (not at_rest) * motion.v[sample])
    found = np.linalg.eigvals(linearise(design, sample, at_rest=at_rest).whole().A)
    expected = np.linalg.eigvals(A)
    expected = expected[np.argsort(np.abs(expected))][4:]  # those of the torque's meters are 0
    for one in expected:
        assert np.abs(found - one).min() < 1e-5 * max(np.abs(one), 1.0)
    assert len(found) == len(expected)


def test_centrifugal_stiffness_of_the_roll_axis_is_that_by_hand(designed):
    """-omega² ((I_x - I_z + m l²) cos 2q + m a l sin q): up to 2.9 kN m/rad at 2.4 rad/s, more than
    the 1.8 of gravity."""
    design = designed("coupled_pi")
    motion = design.reference.tracked
    a, m, length = 2.6, 300.0 + 340.0 + 370.0, 0.18373  # m, kg, m
    I_x, I_z = 95 + 533.8 + 238, 95 + 535.8 + 249.749
    turning = np.flatnonzero(motion.v[:, 0] == motion.v[:, 0].max())[::23]
    assert len(turning) > 100
    stiffness = []
    for sample in turning.tolist():
        q, omega = motion.q[sample].copy(), motion.v[sample, 0]
        q[2:] = 0  # without pitch and yaw
        start = operating_point(design, sample)
        moving, rest = (
            linear_process(design, type(start)(start.period, q[None], v, 0 * start.v)).A[4:8, :4]
            for v in ([[omega, 0, 0, 0]], [[0.0] * 4])
        )
        plant = design.device.simulated.plant
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, q)
        M = plant.CalcMassMatrix(context)
        found = -(M @ (moving - rest))[1, 1]
        spread = (I_x - I_z + m * length**2) * np.cos(2 * q[1])
        expected = -(omega**2) * (spread + m * a * length * np.sin(q[1]))
        assert found == pytest.approx(expected, abs=0.05)
        gravity = m * 9.81 * length * np.cos(q[1])
        assert -(M @ rest)[1, 1] == pytest.approx(gravity, abs=0.05)
        stiffness.append(found)
    assert 2700 < max(np.abs(stiffness)) < 2900


def test_at_rest_only_gravity_is_left_and_the_axis_plant_does_not_notice(designed):
    coupled, axis = designed("coupled_pi"), designed("axis_pi")
    moving, still = (linear(coupled, 2500, at_rest=x).modes() for x in (False, True))
    assert np.abs(np.sort_complex(moving)[0] - np.sort_complex(still)[0]) > 0.01
    for x, y in zip(
        axis.linear(2500).modes(), axis.linear(2500, at_rest=True).modes(), strict=True
    ):
        assert x == y


# --- poles, zeros and singular values of the coupled loop ----------------------------------------


@pytest.mark.parametrize("weight", [1.0, 0.4])
def test_zeros_of_a_coupled_loop_are_those_of_its_controllers(designed, weight):
    """K_P b s + K_I of each joint, whatever the plant, and 0 for each free position."""
    design = designed("coupled_pi", {"controller.setpoint_weight": weight})
    gains, zeros = design.tuning.gains, bode(design, time=8.5).zeros
    assert np.all(np.abs(zeros[:4]) < 1e-6)
    np.testing.assert_allclose(np.sort(zeros[4:].real), np.sort(-gains.ki / gains.kp / weight))


def test_singular_values_bound_every_direction_and_are_attained(designed):
    design = designed("coupled_pi", kind("p_pi") | {"drive.period": 0.001})
    response = frequency_response(design, sample=1700, points=60)
    closed = response.coupled.closed()
    responses = closed.response(response.omega)
    rng = np.random.default_rng(0)
    for _ in range(50):
        direction = rng.normal(size=4) + 1j * rng.normal(size=4)
        gain = np.linalg.norm(responses @ direction, axis=1) / np.linalg.norm(direction)
        assert np.all(gain <= response.singular_values[:, 0] * (1 + 1e-12))
        assert np.all(gain >= response.singular_values[:, -1] * (1 - 1e-12))
    for k in range(4):
        one = response.coupled.closed(k).response(response.omega)[:, 0, 0]
        np.testing.assert_allclose(responses[:, k, k], one, rtol=1e-8, atol=1e-12)
    product = np.abs(np.linalg.det(responses))
    np.testing.assert_allclose(response.singular_values.prod(axis=1), product, rtol=1e-9)


def test_poles_and_zeros_of_a_sampled_loop_are_those_of_z(designed):
    """G(z) loses rank at each zero; the slowest pole lies as in a continuous loop."""
    design = designed("coupled_pi", {"drive.period": 0.0005, "controller.setpoint_weight": 1.0})
    response, alike = bode(design, time=8.5), bode(designed("coupled_pi"), time=8.5)
    closed = response.coupled.closed()
    assert len(response.zeros) >= 8
    for zero in response.zeros[4:]:
        z = np.exp(zero * closed.period)
        G = closed.C @ np.linalg.solve(z * np.eye(len(closed.A)) - closed.A, closed.B + 0j)
        assert np.linalg.svd(G, compute_uv=False)[-1] < 1e-6
    np.testing.assert_allclose(response.poles[4], alike.poles[4], rtol=0.02)


def test_a_page_of_bode_has_the_poles_and_the_figure(tmp_path, capsys, undrawn):
    page = tmp_path / "loops.html"
    assert main(["bode", "coupled_pi", "--time", "8.5", "--out", str(page)]) == 0
    assert "at angles and speeds of the motion at 8.500 s" in capsys.readouterr().out
    text = page.read_text(encoding="utf-8")
    poles = bode(make_design_of("coupled_pi"), time=8.5).poles
    assert text.count('<th scope="row">pole') == np.count_nonzero(poles.imag >= 0)
    assert f">{poles[4].real:.4g}<" in text and text.count("<img") == 2
    assert list(tmp_path.iterdir()) == [page]


def make_design_of(name):
    import sdt_drake as sdt

    return sdt.design(sdt.load(name))
