"""Runs that several tests look at."""

import pytest

from sdt_drake.run.simulate import simulate


@pytest.fixture(scope="session")
def run(designed):
    """A recording of what `designed` makes; each is run once."""
    made = {}

    def get(name, fields=None, **motion):
        key = name, repr(fields), repr(motion)
        if key not in made:
            made[key] = simulate(designed(name, fields, **motion))
        return made[key]

    return get
