"""`sdt-drake`, and `python -m sdt_drake`: a process that ends without a trace when it is told to.

This comes before all large imports: a Ctrl-C that is earlier still finds Python alone.
"""

import sys

# `-m` puts the working directory first, where a file may be called like any module.
if __name__ == "__main__" and not getattr(sys.flags, "safe_path", sys.flags.isolated):
    del sys.path[0]

import atexit
import math
import os
import signal
import time
from types import FrameType

# Before numpy is there: its threads wait for each other busily, and matrices here are small (beside
# other work, to identify from 30 s took 3.4 s of CPU; with one thread 0.6 s).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_AGAIN = 0.02  # s; until a signal within an import is looked at once more
_TIDYING = 1.0  # s; another signal within would disturb it


def _open_streams() -> None:
    """Open what the caller has closed of stdin, stdout and stderr, to nowhere: pipes and files of
    this process and of its children would get their numbers."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


def main() -> int:
    """Run the command line; returns the exit code, 128 + n after signal n."""
    _open_streams()
    heard, when = signal.SIGINT, -math.inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal heard, when
        if number != signal.SIGALRM:
            if time.monotonic() - when < _TIDYING:
                return
            heard, when = signal.Signals(number), time.monotonic()
        if _is_importing(frame):  # Drake would make a fault of it, with a trace
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, stop)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # What is ignored, as below nohup, stays so.
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, stop)
    os.environ.setdefault("PYTHONSAFEPATH", "1")  # the same for the processes of a study
    # Python's own helper tidies up after a process that was ended by force, and need not say so.
    own = os.environ.get("PYTHONWARNINGS")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # it would look for some
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (own, "ignore:resource_tracker")))
    try:
        from sdt_drake.cli.app import main as run

        code = run()
    except KeyboardInterrupt:
        code = 130
    if code == 130:
        atexit._run_exitfuncs()  # temporary folders, for one
        os._exit(128 + heard)  # Python would wait for simulations in threads
    return code


if __name__ == "__main__":
    raise SystemExit(main())
