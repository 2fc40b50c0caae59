"""The command `judge`."""

from typing import Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli.common import Columns, Cutoff, Held, Robot, Side
from sdt_drake.cli.printing import echo, print_document_table


def run(
    robot: Robot,
    recordings: Annotated[list[str], Parameter(name="RECORDING")],
    /,
    *,
    friction: Annotated[str | None, Parameter(metavar="FILE")] = None,
    columns: Columns = None,
    side: Side = None,
    cutoff: Cutoff = None,
    held: Held = Held(),
) -> None:
    """Print the torque of recordings that a robot does not explain, without any fit.

    example: sdt-drake judge identified/robot.sdf run.csv --friction identified/friction.yaml

    Args:
        recordings: CSV files with time, q_k and tau_k for every joint k, or recordings of
            `simulate`
        friction: friction of the joints, as `identify` writes it (default: none)
        cutoff: frequency below which torques are compared [Hz] (default: chosen from the
            recordings)
    """
    from sdt_drake.show.reports.identification import judged_in_words, judged_table

    model = held.load(robot)
    judged = sdt.judge(
        model, recordings, friction=friction, columns=columns, side=side, cutoff=cutoff
    )
    for line in judged_in_words(judged):
        echo(line)
    for one in judged.findings:
        echo(f"warning: {one}")
    echo()
    print_document_table(judged_table(judged))
