"""Which share of a random sample of mutants the tests notice.

    python tests/benchmarks/bench_mutants.py

A mutant is the source with one operator, number, condition or branch changed by cosmic-ray. It
meets the tests that run its statement, those of its own package first. It is written into the
clone, in which nobody may work. mutants.sqlite keeps the results: a run that was stopped goes on,
and survivors meet the tests again; without the files mutants.*, all starts anew. The order is
random, so a run that was stopped has tried a sample of its own.
"""

import ast
import importlib
import json
import math
import os
import random
import re
import resource
import signal
import sys
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import coverage
import pytest
from cosmic_ray.commands import init
from cosmic_ray.modules import find_modules
from cosmic_ray.mutating import mutate_code, use_mutation
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkResult

PACKAGES = ("robot", "motion", "systems", "run", "pilot", "analysis", "paper")
TESTED_BY = (*PACKAGES, "io", "test_step_response.py")  # tests of the boundary are in io
SEED, COUNT = 20, 400
CPU_TIME, TIME = 200, 3600  # [s]; no test takes it, so a mutant that does has a loop without end
OPTIONS = ["-n", "0", "-m", "not documents"]
"""Of pytest: all but the tests of the documents."""
SLOW = {"reproduced", "reproduction", "on_wrong_model", "on_exact_model"}
"""Fixtures that take half a minute: tests that need them try mutants of their own package alone."""
TESTS = Path("mutants.json")
OUTCOMES = {True: TestOutcome.KILLED, False: TestOutcome.SURVIVED}
PRELOADED = ("pydrake.all", "matplotlib.pyplot", "scipy.signal", "scipy.optimize", "hypothesis")
# Floats have no bits, `|` joins annotations, `is` of equal words is true, and classes that lost
# their decorator cannot be made.
IDLE = re.compile(
    r".*(Operator_(BitOr|BitAnd|BitXor|LShift|RShift)_|_(BitOr|BitAnd|BitXor|LShift|RShift|Invert)$"
    r"|_(Eq|NotEq|Lt|LtE|Gt|GtE)_Is(Not)?$|_Is_Eq$|_IsNot_NotEq$|RemoveDecorator$)"
)


# --- the sample ------------------------------------------------------------------------------


def draw(work) -> None:
    """Keep COUNT of all mutants in the session, always the same of a source."""
    init(find_modules(Path("sdt_drake", name) for name in PACKAGES), work, {})
    items = [item for item in work.work_items if not IDLE.match(item.mutations[0].operator_name)]
    items.sort(key=lambda item: place(item.mutations[0]))
    random.Random(SEED).shuffle(items)
    mutants = (item for item in items if is_mutant(item.mutations[0]))
    sample = [item for item, _ in zip(mutants, range(COUNT), strict=False)]
    work.clear()
    work.add_work_items(sample)


def place(mutation) -> tuple:
    return mutation.module_path, mutation.start_pos, mutation.operator_name, mutation.occurrence


def is_mutant(mutation) -> bool:
    """Say whether it is Python, and no star of a signature was taken for an operator."""

    def binary(code: str) -> list[type]:
        return [type(node.op) for node in ast.walk(ast.parse(code)) if isinstance(node, ast.BinOp)]

    old = mutation.module_path.read_text("utf-8")
    new = mutate_code(old, get_operator(mutation.operator_name)(), mutation.occurrence)
    try:
        return binary(old) != binary(new) or "ReplaceBinary" not in mutation.operator_name
    except SyntaxError:
        return False


# --- which tests run a statement -------------------------------------------------------------


class Contexts:
    """A plugin of pytest: coverage keeps lines by test, or by the fixture that tests share."""

    def __init__(self, measured) -> None:
        self.switch, self.now, self.tests = measured.switch_context, "", {}

    def pytest_collection_modifyitems(self, items) -> None:
        slow = [item for item in items if not SLOW.isdisjoint(item.fixturenames)]
        self.tests |= {item.nodeid: (math.inf, item.fixturenames) for item in slow}
        items[:] = [item for item in items if item not in slow]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        start = time.process_time()
        with self.context(item.nodeid):
            done = yield
        self.tests[item.nodeid] = time.process_time() - start, item.fixturenames
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        with self.context(self.now if fixturedef.scope == "function" else fixturedef.argname):
            return (yield)

    @contextmanager
    def context(self, name: str):
        before, self.now = self.now, name
        self.switch(name)
        yield
        self.now = before
        self.switch(before)


def run_all() -> None:
    """Run the tests once, and keep what each runs in mutants.coverage and mutants.json."""
    measured = coverage.Coverage("mutants.coverage", source=["sdt_drake"])
    measured.start()
    plugin = Contexts(measured)
    if pytest.main([*OPTIONS, *(f"tests/{name}" for name in TESTED_BY)], plugins=[plugin]):
        sys.exit(1)
    measured.stop()
    measured.save()
    TESTS.write_text(json.dumps(plugin.tests), encoding="utf-8")


def tests_of(mutation, data: coverage.CoverageData, tests: dict) -> list[list[str]]:
    """Return the tests that run a statement: of its own package, slow ones of it, all others."""
    package, (row, _) = mutation.module_path.parts[1], mutation.start_pos
    by_line = data.contexts_by_lineno(str(mutation.module_path.resolve()))
    contexts = {
        name for line in statement(mutation.module_path, row) for name in by_line.get(line, ())
    }
    chosen: list[list[str]] = [[], [], []]
    for name, (seconds, fixtures) in sorted(tests.items(), key=lambda item: item[1][0]):
        is_own = name.startswith(f"tests/{package}/")
        if seconds == math.inf:
            chosen[1] += [name] * is_own
        elif contexts & {name, *fixtures, *[""] * is_own}:
            chosen[0 if is_own else 2].append(name)
    return chosen


def statement(path: Path, row: int) -> range:
    """Return the lines of the smallest statement around a row, of blocks the head alone."""
    found = range(row, row + 1)
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):  # outer nodes first
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            first = min([node.lineno, *(x.lineno for x in getattr(node, "decorator_list", []))])
            lines = range(first, max(first, body[0].lineno - 1 if body else node.end_lineno) + 1)
            found = lines if row in lines else found
    return found


# --- the run ---------------------------------------------------------------------------------


def in_a_fork(run, output: str = os.devnull) -> int:
    """Return the exit code of `run`, negative after a signal; modules loaded here stay loaded."""
    if (child := os.fork()) == 0:
        file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, 1)
        os.dup2(file, 2)
        code = 1
        try:
            code = int(run() or 0)
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def is_noticed(tests: list[str]) -> bool:
    def run() -> int:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_TIME, CPU_TIME))
        signal.alarm(TIME)
        return pytest.main(["-x", *OPTIONS, "-p", "no:cacheprovider", *tests])

    return bool(tests) and in_a_fork(run) != 0


def main() -> dict[str, float]:
    sys.dont_write_bytecode = False
    if not TESTS.exists() and in_a_fork(run_all, "mutants.log"):
        sys.exit("the tests fail without a mutant: see mutants.log")
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # mutants are not kept compiled, all else is
    sys.dont_write_bytecode = True
    for name in PRELOADED:
        importlib.import_module(name)
    data, tests = coverage.CoverageData("mutants.coverage"), json.loads(TESTS.read_text("utf-8"))
    data.read()
    noticed, tried = Counter(), Counter()
    with use_db("mutants.sqlite") as work:
        if not work.num_work_items:
            draw(work)
        done = {job for job, result in work.results if result.is_killed}
        items = sorted(work.work_items, key=lambda item: place(item.mutations[0]))
        random.Random(SEED).shuffle(items)
        for item in items:
            (mutation,) = item.mutations
            if item.job_id not in done:
                operator = get_operator(mutation.operator_name)()
                chosen = tests_of(mutation, data, tests)
                with use_mutation(mutation.module_path, operator, mutation.occurrence):
                    outcome = OUTCOMES[any(map(is_noticed, chosen))]
                result = WorkResult(WorkerOutcome.NORMAL, test_outcome=outcome)
                work.set_result(item.job_id, result)
                if not result.is_killed:
                    print(*place(mutation), flush=True)
                    continue
            noticed[mutation.module_path.parts[1]] += 1
        tried.update(item.mutations[0].module_path.parts[1] for item in items)
    shares = {name: noticed[name] / tried[name] for name in PACKAGES}
    print({name: f"{noticed[name]} of {tried[name]}" for name in PACKAGES})
    return shares | {"all": noticed.total() / tried.total()}


if __name__ == "__main__":
    main()
