"""Imports run in one direction only: the contracts of import-linter in pyproject.toml hold."""

import subprocess
import sys
from pathlib import Path


def test_every_contract_holds():
    """In a process of its own: import-linter switches all existing loggers off."""
    command = Path(sys.executable).with_name("lint-imports")
    root = Path(__file__).parents[1]
    done = subprocess.run([command, "--no-cache"], cwd=root, capture_output=True, text=True)
    assert done.returncode == 0 and "Contracts: 3 kept, 0 broken" in done.stdout, done.stdout
