"""Seed faults into the package, one at a time, and tell which test catches each of them.

    python tests/faults/run.py                      # all faults: some CPU seconds for each
    python tests/faults/run.py gravity_sign kp_     # faults whose id contains one of these
    python tests/faults/run.py --tree ../other      # of another checkout, with its own tests

Nothing in the checkout changes: faults are put into a temporary copy. A line for each fault goes to
the screen and to --results. The test that is named there runs first, alone, the next time; if it
passes, those files of tests run that have most to do with the file of the fault.
"""

import argparse
import contextlib
import functools
import multiprocessing
import os
import re
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import matplotlib
import pydrake.multibody.parsing
import pydrake.systems.analysis  # noqa: F401  (Drake is loaded once and not for every fault)
import pytest
from hypothesis import Phase, settings

HERE = Path(__file__).resolve().parent
MISSED = "-"


class FirstFailure:
    """Sends the first test that fails, or "" when all have passed."""

    def __init__(self, connection) -> None:
        self._connection = connection

    def pytest_collection(self) -> None:
        """Let examples that fail be as they are: making them small takes most of the time."""
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("faults", settings(), phases=phases)
        settings.load_profile("faults")

    def pytest_runtest_logreport(self, report) -> None:
        self._send_failed(report)

    def pytest_collectreport(self, report) -> None:
        self._send_failed(report)

    def pytest_sessionfinish(self) -> None:
        self._connection.send("")

    def _send_failed(self, report) -> None:
        if report.failed:
            self._connection.send(report.nodeid)


def seed(fault: dict, tree: Path) -> tuple[Path, str]:
    """Put a fault into the tree; its file and what was in it.

    Code moves: the old text is looked for in all of the package if it is not where it was.
    """
    places = [tree / fault["file"], *sorted((tree / "sdt_drake").rglob("*.py"))]
    for path in places:
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if text.count(fault["old"]) == 1:
            path.write_text(text.replace(fault["old"], fault["new"]), encoding="utf-8")
            return path, text
    raise LookupError(f"{fault['id']}: '{fault['old']}' is not in the package once")


def likeliest(tree: Path, file: Path, hint: str) -> list[str]:
    """All files of tests, those first that have to do with a file of the package."""
    package, module = file.relative_to(tree).with_suffix("").parts[-2:]

    def score(path: Path) -> float:
        text = path.read_text(encoding="utf-8")
        return (
            1000 * (str(path.relative_to(tree)) == hint)
            + 20 * (path.stem == f"test_{module}")
            + 6 * (module in path.stem)
            + 12 * (path.parent.name == package)
            + 6 * bool(re.search(rf"{package}(\.| import ){module}\b", text))
            - len(text) / 10_000  # the short ones first
        )

    files = sorted((tree / "tests").rglob("test_*.py"), key=score, reverse=True)
    return [str(path.relative_to(tree)) for path in files]


def caught_by(fault: dict, tree: Path, known: str, limit: float, most: int) -> str:
    """The test that fails with a fault and not without; MISSED if there is none.

    The one known from an earlier run is tried alone, before the likeliest files.
    """
    failing: list[str] = []  # without the fault, too
    path, text = seed(fault, tree)
    seeded = path.read_text(encoding="utf-8")
    files = likeliest(tree, path, known.partition("::")[0])[:most]
    for tests in ([known.partition("[")[0]], files) if "::" in known else (files,):
        while True:
            path.write_text(seeded, encoding="utf-8")
            result = first_failure(tree, tests, limit, failing)
            path.write_text(text, encoding="utf-8")
            if "::" not in result or passes(tree, result, limit):
                break
            failing.append(result)
        if not result.startswith(MISSED):
            break
    return result


@functools.cache
def passes(tree: Path, test: str, limit: float) -> bool:
    """True if a test passes without a fault."""
    return first_failure(tree, [test], limit, []) != test


def first_failure(tree: Path, tests: list[str], limit: float, without: list[str]) -> str:
    """The first test that fails within a time limit [s]; MISSED if all pass, or ... after it."""
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.Process(target=_test, args=(tree, tests, without, theirs))
    process.start()
    theirs.close()
    try:
        if not ours.poll(limit):
            return f"{MISSED} within {limit:g} s"
        return ours.recv() or MISSED
    except EOFError:
        return "the tests crash"
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.join()


def _test(tree: Path, tests: list[str], without: list[str], connection) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.setsid()
    os.chdir(tree)
    sys.path.insert(0, str(tree))
    os.environ["PYTHONPATH"] = str(tree)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    options = ["-x", "-n", "0", "-p", "no:cacheprovider", f"--basetemp={tree.parent / 'pytest'}"]
    options += [f"--deselect={test}" for test in without]
    pytest.main([*options, *tests], plugins=[FirstFailure(connection)])


def read_results(path: Path) -> dict[str, str]:
    """What became of each fault, by id."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return dict(line.split(maxsplit=1) for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("ids", nargs="*", help="parts of ids (default: all faults)")
    parser.add_argument("--tree", type=Path, default=HERE.parents[1], help="checkout to be tested")
    parser.add_argument("--limit", type=float, default=240.0, help="for the tests of a fault [s]")
    parser.add_argument("--files", type=int, default=14, help="files of tests to run for a fault")
    parser.add_argument("--part", default="1/1", help="1/2 and 2/2 in two shells at once")
    parser.add_argument("--missed", action="store_true", help="those only that were not caught")
    parser.add_argument("--new", action="store_true", help="those only that were never run")
    parser.add_argument("--results", type=Path, default=HERE / "caught.txt")
    options = parser.parse_args()
    faults = [
        fault
        for path in sorted(HERE.glob("*.toml"))
        for fault in tomllib.loads(path.read_text(encoding="utf-8"))["fault"]
    ]
    part, parts = map(int, options.part.split("/"))
    known = read_results(options.results)
    chosen = [
        fault
        for fault in faults[part - 1 :: parts]
        if (not options.ids or any(x in fault["id"] for x in options.ids))
        and not (options.missed and not known.get(fault["id"], MISSED).startswith(MISSED))
        and not (options.new and fault["id"] in known)
    ]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # with what it has started
    caught = 0
    with tempfile.TemporaryDirectory(prefix="sdt-faults-") as folder:
        tree = Path(folder) / "tree"
        ignored = shutil.ignore_patterns(".*", "__pycache__")
        shutil.copytree(options.tree, tree, ignore=ignored)
        for fault in chosen:
            start = time.monotonic()
            test = known.get(fault["id"], MISSED)
            try:
                result = caught_by(fault, tree, test, options.limit, options.files)
            except LookupError as error:
                print(error, flush=True)
                continue
            caught += not result.startswith(MISSED)
            known = read_results(options.results) | {fault["id"]: result}  # another part writes too
            lines = (f"{id_:28s} {known[id_]}\n" for id_ in sorted(known))
            options.results.write_text("".join(lines), encoding="utf-8")
            print(f"{fault['id']:28s} {result}  ({time.monotonic() - start:.0f} s)", flush=True)
    print(f"{caught} of {len(chosen)} faults caught")


if __name__ == "__main__":
    matplotlib.use("Agg")
    main()
