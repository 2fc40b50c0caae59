"""The process of `sdt-drake` and `python -m sdt_drake`, which signals end without a traceback.

The handlers of signals are set before all large imports, so that Ctrl-C works during them.
"""

import sys

# `-m` puts the working directory first. A file there may have the name of any module.
if __name__ == "__main__" and not getattr(sys.flags, "safe_path", sys.flags.isolated):
    del sys.path[0]

import atexit
import math
import os
import signal
import time
from types import FrameType

# Set before numpy is imported. Its threads wait busily for each other, and matrices here are small:
# beside other work, identification from 30 s took 3.4 s of CPU, and 0.6 s with one thread.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_RETRY_AFTER = 0.02  # s, after a signal that arrives during an import
_CLEANUP_TIME = 1.0  # s, in which further signals are ignored


def _open_streams() -> None:
    """Connect those of stdin, stdout and stderr that the caller has closed to the null device.

    Otherwise pipes and files of this process and its children would get their numbers.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


def main() -> int:
    """Run the command line and return the exit code, 128 + n after signal n."""
    _open_streams()
    heard, when = signal.SIGINT, -math.inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal heard, when
        if number != signal.SIGALRM:
            if time.monotonic() - when < _CLEANUP_TIME:
                return
            heard, when = signal.Signals(number), time.monotonic()
        if _is_importing(frame):  # Drake would turn the exception into an error with a traceback
            signal.setitimer(signal.ITIMER_REAL, _RETRY_AFTER)
        else:
            raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, stop)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # An ignored signal (as below nohup) stays ignored.
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, stop)
    os.environ.setdefault("PYTHONSAFEPATH", "1")  # for the processes of a study
    # Python's resource tracker would warn when it cleans up after a killed process.
    own = os.environ.get("PYTHONWARNINGS")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # searching for them takes time
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (own, "ignore:resource_tracker")))
    try:
        from sdt_drake.cli.app import main as run

        code = run()
    except KeyboardInterrupt:
        code = 130
    if code == 130:
        atexit._run_exitfuncs()  # for example, remove temporary folders
        os._exit(128 + heard)  # without waiting for simulations in threads
    return code


if __name__ == "__main__":
    raise SystemExit(main())
