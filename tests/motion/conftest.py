"""Commands of profiles that tests write as texts."""

from __future__ import annotations

import pytest
from motions import profile_text

from sdt_drake.motion import load_command


@pytest.fixture
def loaded(tmp_path, robot):
    """The command of a profile with `tracks`."""

    def load(*tracks, robot=robot, **options):
        path = tmp_path / "test.yaml"
        path.write_text(profile_text(*tracks, **options), encoding="utf-8")
        return load_command(path, robot)

    return load
