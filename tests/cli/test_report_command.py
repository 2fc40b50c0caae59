"""Files of `sdt-drake reproduce`: written, replaced, and read again by `sdt-drake report`."""

import json
import shutil
from pathlib import Path

import pytest

from sdt_drake.show.reports.paper import write_report


@pytest.fixture
def folder(reproduced, tmp_path):
    """What the report needs of what reproduce wrote, to change."""
    ignored = shutil.ignore_patterns("*.csv", "*.md", "*.png")
    return Path(shutil.copytree(reproduced, tmp_path / "out", ignore=ignored))


# --- writing --------------------------------------------------------------------------------------


# --- reading again -------------------------------------------------------------------------------


def test_no_text_of_the_summary_becomes_a_tag(folder):
    evil = '<script>alert(1)</script>" onload="x'
    path = folder / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["claims"][0] |= dict.fromkeys(("why", "statement", "id", "published"), evil)
    summary["versions"]["drake"] = evil
    summary["wall_time_s"] = {evil: 1.0}
    summary["beyond"][6] |= {"controller": evil, "needs": [evil], "blocks": evil}
    summary["beyond"][0]["felt"]["channels"][0] = evil
    summary["tracking"][0] |= dict.fromkeys(("controller", "plant", "algorithm"), evil)
    path.write_text(json.dumps(summary), encoding="utf-8")
    page = write_report(folder).read_text(encoding="utf-8")
    assert "alert(1)</script>" not in page and '" onload' not in page
    assert page.count("alert(1)") >= 10
