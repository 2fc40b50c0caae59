"""What is seen in a recording alone, before anything is fitted to it."""

import numpy as np
import pytest
import simulated_recordings as simulated

from sdt_drake.machine.recordings import Finding, check_recording

FAULTS = {
    "jitter": ("uneven", "time", ""),
    "rounded": ("rounded", "time", "time: '', rate: 1"),
    "missing": ("missing", "time", ""),
    "repeated": ("repeated", "q", ""),
    "held": ("held", "tau", "torque_delay: "),
    "frozen_q": ("frozen", "q_", ""),
    "frozen_tau": ("frozen", "tau_", ""),
    "clipped": ("clipped", "tau_", ""),
    "speeds_in_degrees": ("speeds", "v_1", ""),
    "speeds_of_motors": ("speeds", "v_1", ""),
    "speeds_late": ("late", "v", "v: []"),
    "clock": ("clock", "time", "time_factor: 2"),
    "degrees": ("degrees", "", "angle: deg"),
}


@pytest.fixture(scope="module")
def arm():
    """A robot with six joints, recorded without any fault."""
    return simulated.truth("cobot", 1)


def found(truth, recorded) -> list[Finding]:
    return [x for x in check_recording(truth.robot, recorded) if x.kind != "limit"]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_what_to_write(arm, fault):
    kind, place, write = FAULTS[fault]
    said = found(arm, getattr(simulated, fault)(arm, np.random.default_rng(2)))
    assert {x.kind for x in said} == {kind}
    assert said[0].place.startswith(place) and said[0].write.startswith(write)
    assert bool(write) == (" in the mapping file)" in str(said[0]))


@pytest.mark.parametrize("name", simulated.ROBOTS)
def test_nothing_is_said_of_clean_recordings(name):
    truth = simulated.truth(name, 20)
    assert found(truth, truth.recorded) == []
