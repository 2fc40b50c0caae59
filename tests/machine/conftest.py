"""One device that is not quite as its file, and its identification."""

import pytest


@pytest.fixture(scope="session")
def true(robot):
    from helpers.known_truth import true_robot

    return true_robot(robot)


@pytest.fixture(scope="session")
def found(robot, true):
    from helpers.known_truth import recorded_of

    from sdt_drake.machine.identify.procedure import identify

    return identify(robot, [recorded_of(true)])
