"""Learned references: in loops, and as files."""

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
    v, time = wanted.v.copy(), wanted.time
    v[:, 1] += size * 24 * np.pi * np.sin(24 * np.pi * time) * (time < 0.25)
    return Motion.from_speeds(wanted.period, wanted.q[0], v)


def test_the_reference_of_a_file_is_tracked_and_errors_are_against_the_planned_motion(
    p_pi, tmp_path
):
    swing = LearnedReference(with_sine(p_pi.wanted, 1e-3), np.zeros_like(p_pi.wanted.q))
    swing.to_csv(tmp_path / "learned.csv", p_pi.wanted)
    scenario = replace(p_pi.scenario, learned=str(tmp_path / "learned.csv"))
    design = p_pi.variant(scenario)
    run = simulate(design)
    np.testing.assert_array_equal(run.q_ref, p_pi.wanted.q)
    # It goes where the loop takes that reference, were it planned.
    planned = simulate(replace(p_pi, wanted=design.motion))
    np.testing.assert_array_equal(run.q, planned.q)
    assert np.ptp(run.position_error[:, 1]) > 1e-3
    assert design.variant(p_pi.scenario).motion is p_pi.wanted
    with pytest.raises(InputError, match="inverse_dynamics: online"):
        p_pi.variant(replace(scenario, inverse_dynamics="online"))


def test_a_reference_learned_for_a_motion_nearby_is_refused_if_its_file_names_that(p_pi):
    nearby = with_sine(p_pi.wanted, 1e-3)  # within what learning may change
    p_pi.given(LearnedReference(nearby))
    with pytest.raises(InputError, match=r"joint 2 is .* deg from the planned motion"):
        p_pi.given(LearnedReference(nearby, planned=nearby.q))
