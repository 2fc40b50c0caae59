"""What is seen in a recording alone, before anything is fitted to it."""

from __future__ import annotations

import numpy as np
import pytest
import simulated_recordings as simulated

from sdt_drake.machine.recordings import Finding, check_recording

FAULTS = {
    "jitter": ("uneven", "time", "", None),
    "rounded": ("rounded", "time", "time: '', rate: 1", None),
    "missing": ("missing", "time", "", 2.0),
    "repeated": ("repeated", "q", "", None),
    "held": ("held", "tau", "torque_delay: {late}", None),
    "frozen_q": ("frozen", "q_", "", None),
    "frozen_tau": ("frozen", "tau_", "", None),
    "clipped": ("clipped", "tau_", "", None),
    "speeds_in_degrees": ("speeds", "v_1", "", None),
    "speeds_of_motors": ("speeds", "v_1", "", None),
    "speeds_late": ("late", "v", "v: []", 0.04),
    "clock": ("clock", "time", "time_factor: 2", 0.5),
    "degrees": ("degrees", "", "angle: deg", None),
}


@pytest.fixture(scope="module")
def arm():
    """A robot with six joints, recorded without any fault."""
    return simulated.truth("cobot", 1)


def found(truth, recorded) -> list[Finding]:
    return [x for x in check_recording(truth.robot, recorded) if x.kind != "limit"]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_what_to_write(arm, fault):
    kind, place, write, number = FAULTS[fault]
    write = write.format(late=f"{1.5 * np.median(np.diff(arm.recorded.time)):.3g}")
    said = found(arm, getattr(simulated, fault)(arm, np.random.default_rng(2)))
    assert {x.kind for x in said} == {kind}
    assert said[0].place.startswith(place) and said[0].write.startswith(write)
    assert bool(write) == (" in the mapping file)" in str(said[0]))
    assert number is None or said[0].number == pytest.approx(number, rel=0.2)


@pytest.mark.parametrize("name", simulated.ROBOTS)
def test_nothing_is_said_of_clean_recordings(name):
    truth = simulated.truth(name, 20)
    assert found(truth, truth.recorded) == []
