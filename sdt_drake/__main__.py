"""`sdt-drake`, and `python -m sdt_drake`: what ends the process from outside ends it quietly.

This comes before all large imports: a Ctrl-C that is earlier still finds Python alone.
"""

import sys

# `-m` puts the working directory first, where a file may be called like any module.
if __name__ == "__main__" and not getattr(sys.flags, "safe_path", sys.flags.isolated):
    del sys.path[0]

import atexit
import os
import signal
import threading
import time
from types import FrameType

# Before numpy is there: its threads wait for each other busily, and matrices here are small (beside
# other work, to identify from 30 s took 3.4 s of CPU; with one thread 0.6 s).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_AGAIN = 0.02  # s
_PATIENCE = 0.7  # s; what hearing a signal and tidying up may take before it ends without


class _Stop:
    """Handler of signals: a KeyboardInterrupt, one, where Python and Drake can bear it."""

    def __init__(self) -> None:
        self.number = 0  # of the signal that ends the process
        self.working = False  # so there may be something to tidy up
        self._over = False

    def listen(self) -> None:
        for number in _SIGNALS:
            # What is ignored, as below nohup, stays so.
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                signal.signal(number, self)
        signal.signal(signal.SIGALRM, self)
        sys.unraisablehook = self._lost
        reading, writing = os.pipe()
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        threading.Thread(target=self._watch, args=(reading,), daemon=True).start()

    def deafen(self, code: int | None) -> None:
        """All is done; Python's own end takes no interrupt without a trace."""
        self._over = code != 130
        for number in (*_SIGNALS, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if not self.working:
            os._exit(128 + number)
        if not self.number:
            self.number = number
        elif number != signal.SIGALRM:
            return
        if _is_importing(frame):  # Drake makes an ImportError of it, and others lose it
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            raise KeyboardInterrupt

    def _watch(self, reading: int) -> None:
        """End the process where nobody else does: Python hears no signal within a long call."""
        while (number := os.read(reading, 1)[0]) not in _SIGNALS:
            pass
        time.sleep(_PATIENCE)
        if not self._over:
            if processes := sys.modules.get("multiprocessing"):
                for process in processes.active_children():
                    process.kill()
            if errors := sys.modules.get("sdt_drake.io.errors"):
                errors.remove_temporaries()
            os._exit(128 + number)

    def _lost(self, unraisable: "sys.UnraisableHookArgs") -> None:
        """What was raised where nothing takes it, in a destructor for one."""
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            sys.__unraisablehook__(unraisable)


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


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


def main() -> int:
    """Run the command line; returns the exit code, 128 + n after signal n."""
    _open_streams()
    stop, code = _Stop(), None
    stop.listen()
    os.environ.setdefault("PYTHONSAFEPATH", "1")  # the same for the processes of a study
    # Python's own helper tidies up after a process that was ended by force, and need not say so.
    own = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (own, "ignore:resource_tracker")))
    try:
        from sdt_drake.cli.app import main as run

        stop.working = True
        code = run()
    except KeyboardInterrupt:
        code = 130
    finally:
        stop.deafen(code)
    if code == 130:
        atexit._run_exitfuncs()  # temporary folders, for one
        # Python would wait for simulations in threads.
        os._exit(128 + (stop.number or signal.SIGINT))
    return code


if __name__ == "__main__":
    raise SystemExit(main())
