"""Imports run in one direction only: the contracts of import-linter in pyproject.toml hold, and see
what breaks them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LINT = "from importlinter.cli import lint_imports_command as lint; lint(['--no-cache'])"


def broken_contracts(tree: Path) -> list[str]:
    """The contracts that a checkout breaks, by what import-linter prints of them."""
    done = subprocess.run(
        [sys.executable, "-c", LINT],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
    )
    broken = [line.removesuffix(" BROKEN") for line in done.stdout.splitlines() if "BROKEN" in line]
    assert done.returncode == (1 if broken else 0), done.stdout + done.stderr
    return broken


def test_every_contract_holds():
    assert broken_contracts(ROOT) == []


def test_imports_upwards_are_seen_also_those_for_types_alone(tmp_path):
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "sdt_drake", tmp_path / "sdt_drake", ignore=ignored)
    contracts = []
    for file, line, contract in (
        ("studies/job.py", "from sdt_drake.machine import replay", "Each layer imports only those"),
        ("motion/plan.py", "import sdt_drake", "Nothing below the command line imports the face"),
        ("show/diagrams/walk.py", "from sdt_drake.io import errors", "Block diagrams are drawn of"),
    ):
        with (tmp_path / "sdt_drake" / file).open("a") as module:
            module.write(f"\nfrom typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    {line}\n")
        contracts.append(contract)
    broken = broken_contracts(tmp_path)
    assert all(any(one.startswith(contract) for one in broken) for contract in contracts)
