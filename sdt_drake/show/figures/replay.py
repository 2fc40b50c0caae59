"""The figure of a recording and its simulation."""

from matplotlib.figure import Figure

from sdt_drake.io.arguments import typed
from sdt_drake.machine.replay import AS_IT_IS, QUANTITIES, Replay
from sdt_drake.show.panels import Panel, over_time, picture
from sdt_drake.show.style import PALETTE, Look

RECORDED, SIMULATED = Look(PALETTE[0]), Look(PALETTE[1], "--")


@typed
def replay_figure(replay: Replay) -> Figure:
    """Draw recorded and simulated errors and torques, a row for each joint."""
    time, names = replay.design.reference.tracked.time, replay.design.device.simulated.joint_names
    columns: list[list[Panel]] = []
    for name, measured in replay.measured.items():
        metric, simulated = QUANTITIES[name], replay.courses[AS_IT_IS][name]
        lines = [
            ("recorded", RECORDED, metric.factor * measured),
            ("simulated", SIMULATED, metric.factor * simulated),
        ]
        label = f"{metric.label}, motor side" if name == "torque" else metric.label
        columns.append(over_time(label, time, lines, () if columns else names))
    return picture(f"{replay_title(replay)}: recorded and simulated", columns)


def replay_title(replay: Replay) -> str:
    """Return the title of a report: the recording and the scenario."""
    return f"{replay.recorded.path.name} in {replay.design.scenario.name}"
