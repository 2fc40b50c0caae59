"""Step responses of the speed loops, by the paper's figures and by formulas of second order.

They are simulated by the diagram of diagrams/figure4_step_response.py, for all four axes.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest
from oracles.second_order import Formula

from sdt_drake.analysis.step import step_metrics
from sdt_drake.paper.published import FIGURE4, FIGURE4_ZETA, OMEGA_R, table1
from sdt_drake.systems.gains import STRUCTURES, SpeedGains, tune

SCRIPT = Path(__file__).resolve().parents[1] / "diagrams/figure4_step_response.py"
I_MAX, K_PS, K_IS = (np.array(table1(x)) for x in ("i_eff_max", "kp", "ki"))
INERTIA = {"max": I_MAX, "min": I_MAX * (1 - np.array(table1("variation_percent")) / 100)}
TABLE1 = SpeedGains(kp=K_PS, ki=K_IS)
BOTH = {"pi": TABLE1, "p_in_feedback": TABLE1}


@pytest.fixture(scope="module")
def simulate():
    return runpy.run_path(str(SCRIPT))["simulate"]


@pytest.fixture(scope="module")
def on_table1(simulate):
    """Time and speeds by structure of all axes with the gains of Table 1, by inertia."""
    return {name: simulate(BOTH, i_eff)[1:] for name, i_eff in INERTIA.items()}


def formulas(level):
    return [Formula(*axis) for axis in zip(INERTIA[level], K_PS, K_IS, strict=True)]


# --- a step of the reference ------------------------------------------------------------------


PRINTED = {"pi": (0.022, 0.16, 13.53), "p_in_feedback": (0.094, 0.159, 0.0)}
COMPUTED = {"pi": (0.0221, 0.1634, 13.534), "p_in_feedback": (0.0944, 0.1595, 0.007)}


def test_axis_tuned_as_figure_4_has_figures_of_the_paper(simulate):
    """Rise and settling time [s], overshoot [%]: omega_n and zeta are those of axis 1 on all."""
    gains = {name: tune(I_MAX, OMEGA_R, zeta) for name, zeta in FIGURE4_ZETA.items()}
    _, t, speeds = simulate(gains, I_MAX)
    for structure, by_axis in speeds.items():
        for v in by_axis.T:
            m = step_metrics(t, v, y0=0, y_final=1)
            found = (m.rise_time, m.settling_time, m.overshoot_percent)
            assert np.all(np.abs(np.subtract(found, PRINTED[structure])) < (6e-4, 5e-3, 0.01))
            assert found[:2] == pytest.approx(COMPUTED[structure][:2], abs=6e-5)
            assert found[2] == pytest.approx(COMPUTED[structure][2], abs=6e-4)
            assert abs(m.steady_state_error) < 2e-7


@pytest.mark.parametrize("level", INERTIA)
def test_damping_equals_table_1(level):
    for axis, printed in zip(formulas(level), table1(f"zeta_{level}"), strict=True):
        assert axis.zeta == pytest.approx(printed, abs=0.01)


@pytest.mark.parametrize("level", INERTIA)
@pytest.mark.parametrize("structure", FIGURE4)
def test_step_of_reference_follows_formula(on_table1, level, structure):
    (t, speeds), b = on_table1[level], STRUCTURES[structure]
    for axis, v in zip(formulas(level), speeds[structure].T, strict=True):
        np.testing.assert_allclose(v, axis.reference_step(b, t), rtol=0, atol=1e-9)
        m = step_metrics(t, v, y0=0, y_final=1)
        assert (m.rise_time, m.settling_time) == pytest.approx(axis.times(b), abs=1.1e-5)
        assert m.overshoot_percent == pytest.approx(axis.overshoot_percent(b), abs=1e-4)
        assert abs(m.steady_state_error) < 2e-5


def test_overshoot_is_none_for_i_p_and_7_to_14_percent_for_pi(on_table1):
    """Of I-P there is none at zeta >= 1; the zero of the other gives 7 to 14 %."""
    _, speeds = on_table1["min"]
    over = {x: 100 * (v.max(axis=0) - 1) for x, v in speeds.items()}
    assert np.all(over["p_in_feedback"] < 1e-9)
    assert np.all((over["pi"] > 7) & (over["pi"] < 14))


# --- a step of the load -----------------------------------------------------------------------


@pytest.mark.parametrize("level", INERTIA)
def test_step_of_load_leaves_no_speed_error_and_integral_stiffness(simulate, level):
    """The structure does not matter: the reference does not change. K_IS holds the angle."""
    load = 100.0  # N m
    _, t, speeds = simulate(BOTH, INERTIA[level], v_ref=0.0, load_torque=load)
    np.testing.assert_array_equal(speeds["pi"], speeds["p_in_feedback"])
    for axis, v, ki in zip(formulas(level), speeds["pi"].T, K_IS, strict=True):
        np.testing.assert_allclose(v, load * axis.load_step(t), rtol=0, atol=1e-9 * load)
        peak = (np.arctanh(axis.beta / axis.sigma) / axis.beta).real
        assert t[np.argmin(v)] == pytest.approx(peak, abs=6e-5)
        assert abs(v[-1]) < 2e-5 * abs(v).max()
        assert np.trapezoid(v, t) == pytest.approx(-load / ki, rel=1e-5)
