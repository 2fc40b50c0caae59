"""Imports run in one direction only: the contracts of import-linter in pyproject.toml hold."""

from __future__ import annotations

from pathlib import Path

from importlinter.cli import lint_imports

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def test_every_contract_holds(capsys):
    assert lint_imports(str(PROJECT), no_cache=True) == 0, capsys.readouterr().out
    assert "Contracts: 3 kept, 0 broken" in capsys.readouterr().out
