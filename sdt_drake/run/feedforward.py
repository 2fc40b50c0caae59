"""The torques of the reference as a diagram: feedforward, load torque and alleviating torque."""

from typing import cast

from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, PassThrough

from sdt_drake.io.arrays import Array
from sdt_drake.robot.deviation import Deviation
from sdt_drake.run.design import Design
from sdt_drake.systems import LoadTorque, ReferenceTorque, signal_table
from sdt_drake.systems.reference import start_table
from sdt_drake.systems.wiring import build


def make_feedforward(design: Design, *, adds: bool, feeds: tuple[str, ...]) -> System:
    """Make the torques of the reference, and the sum tau_cmd = tau_fb + tau_ff (Figures 3 and 6).

    Input `tau_fb`, the feedback torque; `reference` too, if the inverse dynamics is online. Outputs
    `tau_cmd`, `tau_ff` if it is added, and those of `load_torque` and `alleviating_torque`
    (Algorithm 1) that are asked for.
    All torques are motor side [N m].

    The paper's tau_ff is the load torque tau_LD, which leaves the joint's own acceleration
    (d_kk vd_ref) to the feedback.

    Args:
        design: the design of the loop.
        adds: True to add the design's feedforward; else tau_cmd = tau_fb.
        feeds: names of the other outputs, without `tau_cmd`.
    """
    builder, n = DiagramBuilder(), design.device.simulated.n
    add, is_online = builder.AddNamedSystem, design.scenario.inverse_dynamics == "online"
    has_feedforward = adds and design.tuning.feedforward.along is not None
    feeds_load = has_feedforward and _is_load_torque(design)
    if not (feeds or has_feedforward):
        return PassThrough(n)

    total = add("tau_cmd", Adder(2, n) if has_feedforward else PassThrough(n))
    builder.ExportInput(total.get_input_port(0), "tau_fb")
    builder.ExportOutput(total.get_output_port(), "tau_cmd")
    tau_ff = None
    if names := tuple(dict.fromkeys((*feeds, *["load_torque"] * feeds_load))):
        load: System
        if is_online:
            algorithm = design.scenario.algorithm
            load = add("load_torque", LoadTorque(robot=design.loaded, algorithm=algorithm))
        else:
            signals = {name: getattr(design.loads, name) for name in names}
            load = add("load_torque_table", table_of(design, **signals))
        for name in feeds:
            builder.ExportOutput(load.GetOutputPort(name), name)
        tau_ff = load.GetOutputPort("load_torque") if feeds_load else None
    if has_feedforward and tau_ff is None:
        law = design.tuning.feedforward.law
        if is_online and law is not None:
            torque = ReferenceTorque(
                robot=law.model, outputs=("tau_ff",), law=lambda *sample: [law(*sample)]
            )
            tau_ff = add("feedforward_torque", torque).get_output_port()
        else:
            table = table_of(design, tau_ff=cast(Array, design.tuning.feedforward.along))
            tau_ff = add("feedforward_table", table).get_output_port()
    if tau_ff is not None:
        builder.Connect(tau_ff, total.get_input_port(1))
        builder.ExportOutput(tau_ff, "tau_ff")
    online = [block for block in builder.GetSystems() if isinstance(block, ReferenceTorque)]
    for block in online[:1]:
        builder.ExportInput(block.get_input_port(), "reference")
    for block in online[1:]:
        builder.ConnectInput("reference", block.get_input_port())
    return build(builder, "feedforward")


def _is_load_torque(design: Design) -> bool:
    """Return whether the feedforward is exactly the load torque of the loop (Figure 6)."""
    law, scenario = design.tuning.feedforward.law, design.scenario
    if law is None or law.kind != "ctc" or scenario.controller.feedforward_gain is not None:
        return False
    if law.friction is not None or design.reference.torque is not None:
        return False
    is_axis = scenario.plant.kind == "axis"
    load = scenario.plant.deviation if is_axis else Deviation()  # of `design.loaded`
    model = scenario.controller.model
    return model == load or (model.exact and load.exact)


def start_feedforward(block: System, context: Context) -> None:
    """Set the tables of a feedforward, in its own context, to their first samples."""
    for table in block.GetSystems() if isinstance(block, Diagram) else ():
        if table.get_name().endswith("_table"):
            start_table(table, block.GetMutableSubsystemContext(table, context))


def table_of(design: Design, **signals: Array) -> Diagram:
    """Make a table of signals along the motion that arrive with the reference."""
    delay = design.drive.reference_delay
    return signal_table(motion=design.reference.held, signals=signals, delay=delay)
