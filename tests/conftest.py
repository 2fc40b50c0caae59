"""Fixtures for those who run tests; who only starts them needs neither these nor Drake."""

from __future__ import annotations

import os

from hypothesis import settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # or idle threads of it fight for the cores

settings.register_profile("suite", derandomize=True, deadline=None, database=None, max_examples=30)
settings.load_profile("suite")


def pytest_configure(config):
    if config.getoption("numprocesses", None):  # they, and all that tests start, compile code once
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    else:
        for name in ("prepared", "browser", "command_line"):
            config.pluginmanager.import_plugin(name)
