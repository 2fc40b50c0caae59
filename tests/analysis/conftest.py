"""What tests of the analysis share."""

from __future__ import annotations

import pytest


@pytest.fixture
def without_graphviz(monkeypatch, tmp_path) -> None:
    """A PATH with nothing on it."""
    monkeypatch.setenv("PATH", str(tmp_path))
