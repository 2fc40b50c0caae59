"""The command `fly`."""

from typing import Annotated

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Columns, Flag, OutFolder, Robot, Trust, number, one_of
from sdt_drake.cli.printing import echo, echo_wrapped, print_table

_Seconds = Annotated[float, number(gt=0)]
_INTERRUPTED = 130
_FIXED, _OF_ONE, _OF_FRONT = 7.0, 0.035, 0.06  # computing time, once and for each knot [s]


def run(
    robot: Robot,
    flight: Annotated[str, one_of("flight")],
    /,
    *,
    out: OutFolder,
    columns: Columns = None,
    approach: _Seconds = 15.0,
    departure: _Seconds = 15.0,
    idle_g: Annotated[float | None, number(gte=1, lte=10)] = None,
    g_weight: Annotated[float, number(gt=0)] = 0.3,
    vertical_weight: Annotated[float, number(gte=0)] = 1.0,
    acceleration_weight: Annotated[float, number(gte=0)] = 0.1,
    torque_margin: Annotated[float, number(gt=0, lte=1)] = 0.95,
    knot: _Seconds = 0.2,
    model: Annotated[str, one_of("perception model")] = "slow_yaw",
    envelope: Annotated[str | None, one_of("scenario")] = None,
    alone: Flag = False,
    online: Flag = False,
    trust: Trust = False,
) -> int | None:
    """Search for a motion that is felt like a recorded flight, within all limits of the device.

    Ctrl-C or SIGTERM ends the search and writes the best motion so far; at first that is rest.

    example: sdt-drake fly sdt turn --out flown

    Args:
        robot: robot with a pilot's head and at least two joints: shipped name, SDF or URDF file
        flight: CSV file with time, specific force and angular rate at the pilot's head (f_x, f_y,
            f_z, omega_x, omega_y, omega_z; x forward, y left, z up), or the name of a shipped one
        out: folder for motion.csv, summary.json and report.html
        columns: YAML file with the names of the columns, their units, axes and position; `jsbsim`,
            `px4`, `ardupilot`, `g1000`, `fdr`, `xplane` and `recorder` are shipped
        approach: time from rest to the start of the flight [s]
        departure: time from the end of the flight to rest [s]
        idle_g: G before and after the flight (default: that of its first and last sample)
        g_weight: weight of the squared error of G over its threshold of perception, beside 1 for
            the felt rotation; more gives a smaller error
        vertical_weight: the same for the felt vertical
        acceleration_weight: the same for the felt acceleration
        torque_margin: share of the motors' torque to use, in (0, 1]
        knot: time between the knots of the motion [s]
        model: parameter set of the perception model
        envelope: scenario with the torque-speed envelope of the device, as in `plan`
        alone: leave out the search without torque limits and the Pareto front
        online: compare with an online cueing, which does not know the flight to come
    """
    from sdt_drake.cli.plan import driven
    from sdt_drake.io.signals import holding_signals
    from sdt_drake.machine.cueing.flight import read_flight
    from sdt_drake.machine.cueing.procedure import fly
    from sdt_drake.machine.cueing.reach import reach
    from sdt_drake.machine.diagnose.flight import check_flight
    from sdt_drake.pilot.observer import load_perception
    from sdt_drake.pilot.orientation import CAUTION
    from sdt_drake.show.reports.fly import FILES, write_flown

    common.check_folder(out, FILES)
    device = sdt.load_robot(robot) if envelope is None else driven(envelope, None)
    recorded = read_flight(flight, columns)
    load_perception(model)  # refused before anything is printed
    for line in check_flight(recorded):
        echo(f"{'note' if line.kind == 'reading' else 'suspicious'}: {line}")
    echo(str(reach(device, recorded)))
    knots = (approach + recorded.duration + departure) / knot
    seconds = _FIXED + knots * (_OF_ONE if alone else _OF_FRONT)
    span = f"{seconds:.0f} to {2 * seconds:.0f} s of computing"
    echo(f"The search takes about {span}; Ctrl-C ends it with what it has.")
    flown = fly(
        device, recorded, approach=approach, departure=departure, idle_g=idle_g, knot=knot,
        torque_margin=torque_margin, g_weight=g_weight, vertical_weight=vertical_weight,
        acceleration_weight=acceleration_weight, perception=model, compare=not alone,
        online=online,
    )  # fmt: skip
    with holding_signals():
        page = write_flown(out, flown)
        summary = flown.summary()
        echo_wrapped(f"{recorded.name}: {flown.answer} (RMS errors of the head's motion).")
        if flown.online:
            echo_wrapped(f"{flown.online_answer[0].upper()}{flown.online_answer[1:]}.")
        echo(summary.title)
        print_table(summary.header, summary.rows)
        echo_wrapped(CAUTION)
        echo(f"{page} written")
    if flown.numbers["interrupted"]:
        echo("interrupted: this is the best motion found so far")
        return _INTERRUPTED
    return None
