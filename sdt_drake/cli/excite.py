"""The command `excite`."""

from typing import Annotated, Literal

from cyclopts import Parameter

from sdt_drake.cli import common
from sdt_drake.cli.common import Held, Out, Robot, number
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.arguments import whole_periods


def run(
    robot: Robot = common.ROBOT,
    /,
    *,
    duration: Annotated[float, number(gte=1)] = 30.0,
    only: Literal["payload"] | None = None,
    payload: str | None = None,
    margin: Annotated[float | None, number(gt=0, lte=1)] = None,
    acceleration: Annotated[list[float] | None, Parameter(consume_multiple=True)] = None,
    noise: Annotated[float | None, number(gt=0, lte=1)] = None,
    out: Out = None,
    held: Held = Held(),
) -> None:
    """Find a motion that identifies a robot best, and predict how well it does.

    example: sdt-drake excite sdt --duration 30 --out excite.yaml

    Args:
        duration: duration of the motion [s]
        only: excite the payload alone, with a gentle motion; all else must be known
        payload: link that `--only payload` excites (default: payload)
        margin: share of the limits of position, speed, acceleration and torque to use (default:
            0.8)
        acceleration: acceleration limits of the joints [rad/s²] (default: those of the robot's
            file, else the accelerations that the motors allow)
        noise: standard deviation of the measured torques, as a share of each joint's torque limit
            (default: 0.01)
        out: motion file (.yaml) to write
    """
    from sdt_drake.analysis.metrics import PARAMETERS_IN_WORDS
    from sdt_drake.io.shown import formatted
    from sdt_drake.machine.identify.excitation import GENTLY, MARGIN, RATE, excite
    from sdt_drake.machine.identify.limits import assumed
    from sdt_drake.machine.identify.targets import NOISE, Target
    from sdt_drake.motion import INTERPOLATION_PERIOD

    whole_periods(duration, INTERPOLATION_PERIOD, "--duration")
    if out is not None:
        common.check_file(out, (".yaml", ".yml"))
    margin, noise = margin or MARGIN, noise or NOISE
    model = held.load(robot)
    gently = 1.0
    target = Target.everything(model, noise)
    if only is not None:
        target, gently = Target.payload(model, payload or "payload", noise), GENTLY
    found = excite(target, duration, margin=margin, gently=gently, acceleration=acceleration)
    echo(
        f"{model.name}: {duration:g} s of motion identify {len(target.names)} parameters with "
        f"condition number {found.condition:.3g} (harmonics of {found.base_frequency:g} Hz)"
    )
    if out is None:
        echo("next: write the motion with --out excite.yaml and record it on the machine")
    else:
        echo(f"next: record {out} on the machine, then sdt-drake identify with the recording")
    if found.fitted < duration:
        echo(f"From {found.fitted:g} s on, another motion follows, which `identify` holds out.")
    for line in assumed(model, acceleration):
        echo(f"assumed: {line}")
    columns = [(f"{name} [%]", ".1f", 100 * use) for name, use in found.used.items()]
    print_joints(model.joint_names, columns)
    echo("in % of the limits; obstacles and people in the machine are not taken into account")
    echo()
    echo(f"{'std':>12}{'in the file':>14}  parameter")
    for name, value, sigma in zip(target.names, target.expected, found.sigma, strict=True):
        known = formatted(0.0 if abs(value) < 1e-9 else value, ".5g")
        echo(f"{sigma:12.3g}{known:>14}  {name}")
    echo(
        f"std: expected standard deviation, from the first {found.fitted:g} s at {RATE:g} Hz with "
        f"torque noise of {100 * noise:g} % of each joint's torque limit"
    )
    echo(PARAMETERS_IN_WORDS)
    if out is not None:
        found.save(out)
        echo(f"{out} written")
