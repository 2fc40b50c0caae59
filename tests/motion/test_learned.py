"""References that flights have taught: in loops, and as files."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.io.errors import InputError
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.run.simulate import simulate


@pytest.fixture
def p_pi(designed):
    """The cascade without feedforward, 0.5 s of the reference motion."""
    base = designed("coupled_pi", start=2.0, end=2.5)
    return base.variant(with_controller(base.scenario, "p_pi"))


def with_sine(wanted: Motion, size: float) -> Motion:
    """Joint 2 swings beside its motion, at 12 Hz for 0.25 s [rad]."""
    v = wanted.v.copy()
    time = wanted.time
    v[:, 1] += size * 24 * np.pi * np.sin(24 * np.pi * time) * (time < 0.25)
    return Motion.from_speeds(wanted.period, wanted.q[0], v)


def test_a_learned_reference_is_followed_and_errors_are_against_the_planned_motion(p_pi):
    learned = LearnedReference(with_sine(p_pi.wanted, 1e-3))
    design = p_pi.given(learned)
    assert design.motion is learned.motion and design.wanted is p_pi.wanted
    run = simulate(design)
    np.testing.assert_array_equal(run.q_ref, p_pi.wanted.q)
    # It goes where the loop takes that reference, were it planned.
    planned = simulate(replace(design, wanted=design.motion, learned=None))
    np.testing.assert_array_equal(run.q, planned.q)
    assert np.ptp(run.position_error[:, 1]) > 1e-3


def test_a_learned_torque_is_fed_forward(p_pi):
    """The inverse dynamics learned are as good as the inverse dynamics computed."""
    computed = p_pi.variant(with_controller(p_pi.scenario, "p_pi+id"))
    torque = computed.tau_ff - computed.steady_ff
    learned = p_pi.given(LearnedReference(p_pi.wanted, torque))
    np.testing.assert_allclose(simulate(learned).q, simulate(computed).q, rtol=0, atol=1e-9)


def test_a_scenario_names_it_by_a_file(p_pi, tmp_path):
    file = tmp_path / "learned.csv"
    torque = np.ones_like(p_pi.wanted.q)
    LearnedReference(with_sine(p_pi.wanted, 1e-3), torque).to_csv(file, p_pi.wanted)
    scenario = copy.deepcopy(p_pi.scenario)
    scenario.learned = str(file)
    design = p_pi.variant(scenario)
    np.testing.assert_array_equal(design.motion.q, Motion.from_csv(file).q)
    np.testing.assert_array_equal(design.tau_ff, torque)
    assert design.variant(p_pi.scenario).motion is p_pi.wanted
    scenario.inverse_dynamics = "online"
    with pytest.raises(InputError, match="inverse_dynamics: online"):
        p_pi.variant(scenario)


def test_what_was_learned_of_a_motion_that_is_near_is_refused(p_pi, tmp_path):
    """A twentieth slower: within what learning may change, were it of this motion."""
    wanted, file = p_pi.wanted, tmp_path / "learned.csv"
    start = np.clip(wanted.time / 0.1, 0, 1)[:, None]
    slower = Motion.from_speeds(wanted.period, wanted.q[0], wanted.v * (1 - 0.05 * start))
    LearnedReference(slower).to_csv(file, slower)
    own = LearnedReference.from_csv(file)
    own.check(slower, p_pi.nominal, torque_margin=1.0)
    replace(own, planned=None).check(wanted, p_pi.nominal, torque_margin=1.0)
    with pytest.raises(InputError, match=r"joint \d is .* deg from the planned motion"):
        own.check(wanted, p_pi.nominal, torque_margin=1.0)


def moved(motion: Motion, k: int, angle: float) -> Motion:
    return replace(motion, q=motion.q + angle * np.eye(motion.n)[k])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: replace(m, q=m.q[:-1], v=m.v[:-1], vd=m.vd[:-1]), "101 samples of 0.005 s"),
        (lambda m: replace(m, period=0.004), "samples of 0.004 s"),
        (lambda m: moved(m, 2, 1e-6), "joint 3 starts 1e-06"),
        (lambda m: with_sine(m, 0.06), "joint 2 is .* deg from the planned motion"),
        (lambda m: with_sine(m, 0.01), "joint 2 'roll' at .* needs torque"),
    ],
)
def test_what_was_not_learned_of_the_motion_or_is_beyond_a_limit_is_refused(p_pi, change, words):
    with pytest.raises(InputError, match=words):
        p_pi.given(LearnedReference(change(p_pi.wanted)))
