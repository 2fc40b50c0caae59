"""Read each file in a process of its own, with twice the time of SECURITY.md and its memory."""

import os
import resource
import sys
import traceback

import pyarrow.parquet  # noqa: F401  # what readers import late counts to none of them
import scipy.io.matlab  # noqa: F401

from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import read_table
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.scenario import load_scenario

SECONDS, BYTES = 8, 3_000_000_000
READERS = {"sdf": load_robot, "yaml": load_scenario}


def read(path):
    """Print what is wrong with a file, and end the process."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    try:
        READERS.get(path.rpartition(".")[2], read_table)(path)
    except InputError as error:
        print(error.lines[0], flush=True)
    except BaseException:
        traceback.print_exc()
    os._exit(0)


for file in sys.argv[1:]:
    child = os.fork()
    if not child:
        read(file)
    _, status = os.waitpid(child, 0)
    if status:  # of a signal, such as SIGXCPU
        print(f"{file}: ended by signal {status}", flush=True)
