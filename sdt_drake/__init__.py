"""Motion control of spatial disorientation trainers, as Drake systems diagrams.

This module offers the functions and classes of daily use and imports each at its first use:

    import sdt_drake as sdt

    design = sdt.design(sdt.load("coupled_pi_ctc"))
    run = sdt.simulate(design)
    print(sdt.track(run).max_abs_speed_error)  # [rad/s], joint side

The packages, from the bottom up: `io` (files), `robot` (SDF, dynamics), `motion` (profiles and
planners), `systems` (Drake blocks), `run` (scenario, design, loop, simulation), `pilot` (what a
pilot feels), `analysis` (numbers of runs), `studies` (many runs), `machine` (the real machine),
`show` (figures, reports), `paper` (its claims), `cli` (commands).
"""

TYPE_CHECKING = False  # importing it from `typing` would double the time of our own import
if TYPE_CHECKING:
    from sdt_drake.analysis.comparison import compare
    from sdt_drake.analysis.frequency_response import bode
    from sdt_drake.analysis.linear import linear
    from sdt_drake.analysis.loop_step import step
    from sdt_drake.analysis.stability import stability
    from sdt_drake.analysis.stops import stops
    from sdt_drake.analysis.tracking import track
    from sdt_drake.io.errors import InputError
    from sdt_drake.machine.accept.judge import accept_judge
    from sdt_drake.machine.accept.plan import accept_plan
    from sdt_drake.machine.accept.predict import accept_predict
    from sdt_drake.machine.cueing.online import OnlineCueing
    from sdt_drake.machine.cueing.procedure import fly
    from sdt_drake.machine.cueing.udp import UdpFlight
    from sdt_drake.machine.drive_files.export import export
    from sdt_drake.machine.identify.judge import judge
    from sdt_drake.machine.identify.procedure import identify
    from sdt_drake.machine.learn.procedure import learn
    from sdt_drake.machine.learn.recorded_step import learn_update
    from sdt_drake.machine.replay import replay
    from sdt_drake.motion import Motion
    from sdt_drake.motion import load_plan as plan
    from sdt_drake.pilot.orientation import perceive
    from sdt_drake.robot.robot import load_robot
    from sdt_drake.run.controllers import Controller, ControllerOptions, register_controller
    from sdt_drake.run.design import make_design as design
    from sdt_drake.run.design import tune
    from sdt_drake.run.loop import make_loop as loop
    from sdt_drake.run.recording import Recording
    from sdt_drake.run.scenario import Scenario
    from sdt_drake.run.scenario import load_scenario as load
    from sdt_drake.run.scenario import save_scenario as save
    from sdt_drake.run.simulate import simulate
    from sdt_drake.show.figures import motions as plots_motion
    from sdt_drake.show.figures import pilot as plots_pilot
    from sdt_drake.show.figures import runs as plots
    from sdt_drake.show.view3d.viewer import view

__version__ = "0.4.0"

_PLACES = {
    "load": "run.scenario:load_scenario",
    "save": "run.scenario:save_scenario",
    "load_robot": "robot.robot:load_robot",
    "plan": "motion:load_plan",
    "design": "run.design:make_design",
    "loop": "run.loop:make_loop",
    "simulate": "run.simulate:simulate",
    "tune": "run.design:tune",
    "bode": "analysis.frequency_response:bode",
    "identify": "machine.identify.procedure:identify",
    "judge": "machine.identify.judge:judge",
    "replay": "machine.replay:replay",
    "learn": "machine.learn.procedure:learn",
    "learn_update": "machine.learn.recorded_step:learn_update",
    "accept_plan": "machine.accept.plan:accept_plan",
    "accept_judge": "machine.accept.judge:accept_judge",
    "accept_predict": "machine.accept.predict:accept_predict",
    "export": "machine.drive_files.export:export",
    "fly": "machine.cueing.procedure:fly",
    "OnlineCueing": "machine.cueing.online:OnlineCueing",
    "UdpFlight": "machine.cueing.udp:UdpFlight",
    "track": "analysis.tracking:track",
    "compare": "analysis.comparison:compare",
    "linear": "analysis.linear:linear",
    "step": "analysis.loop_step:step",
    "stops": "analysis.stops:stops",
    "stability": "analysis.stability:stability",
    "perceive": "pilot.orientation:perceive",
    "view": "show.view3d.viewer:view",
    "plots": "show.figures.runs:",
    "plots_motion": "show.figures.motions:",
    "plots_pilot": "show.figures.pilot:",
    "Scenario": "run.scenario:Scenario",
    "Motion": "motion:Motion",
    "Recording": "run.recording:Recording",
    "Controller": "run.controllers:Controller",
    "ControllerOptions": "run.controllers:ControllerOptions",
    "register_controller": "run.controllers:register_controller",
    "InputError": "io.errors:InputError",
}
__all__ = [
    "Controller", "ControllerOptions", "InputError", "Motion", "OnlineCueing", "Recording",
    "Scenario", "UdpFlight", "accept_judge", "accept_plan", "accept_predict", "bode", "compare",
    "design", "export", "fly", "identify", "judge", "learn", "learn_update",
    "linear", "load", "load_robot", "loop", "perceive", "plan", "plots", "plots_motion",
    "plots_pilot", "register_controller", "replay", "save", "simulate", "stability", "step",
    "stops", "track", "tune", "view",
]  # fmt: skip


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import pkgutil

    return pkgutil.resolve_name(f"{__name__}.{_PLACES[name]}")


def __dir__() -> list[str]:
    return [*_PLACES, *(name for name in globals() if name.startswith("__"))]
