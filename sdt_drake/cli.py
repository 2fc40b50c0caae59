"""The command line `sdt-drake`."""

from __future__ import annotations

import argparse
import logging
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import sdt_drake
from sdt_drake import paper
from sdt_drake.errors import InputError, checked_number

# The heavy imports stand in the commands: --help and --version answer at once.

BAD_INPUT = 2

MOTION = "package://sdt/motions/reference.yaml"
ROBOT = "package://sdt/sdt.sdf"


class _Parser(argparse.ArgumentParser):
    """Errors as one line, like those of the program itself."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code: 0, or 2 after one line about bad input."""
    if sys.stdout is None:  # closed by whoever called us
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter is no error
    # Drake also logs what it raises. (It sets the logger's level itself, when it is imported.)
    logging.getLogger("drake").addFilter(lambda record: False)
    try:
        options = _parser().parse_args(arguments)
        options.command(options)
        sys.stdout.flush()
    except InputError as error:
        return _refuse(str(error))
    except BrokenPipeError:
        _stop_printing()
    except OSError as error:
        return _refuse(f"{error.filename or 'files'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return 130
    return 0


def _refuse(message: str) -> int:
    print(f"sdt-drake: {' '.join(message.splitlines())}", file=sys.stderr)
    return BAD_INPUT


def _say(text: str = "") -> None:
    """Print a line; whoever reads us may have enough, the results are written all the same."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _stop_printing()


def _stop_printing() -> None:
    # Python would complain once more at exit.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="sdt-drake",
        description="Motion control of spatial disorientation trainers, in Drake.",
        epilog="example: sdt-drake reproduce --out out",
    )
    parser.add_argument("--version", action="version", version=f"sdt-drake {sdt_drake.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)

    reproduce = _command(
        commands, "reproduce", _reproduce,
        "recompute the study of the paper: tables, figures, diagrams, claims",
        "sdt-drake reproduce --out out",
    )  # fmt: skip
    _add_out(reproduce, "folder for the results", default="out")

    plan = _command(
        commands, "plan", _plan,
        "plan a motion within the motors' torques",
        "sdt-drake plan package://sdt/motions/reference.yaml --out motion.csv",
    )  # fmt: skip
    plan.add_argument("motion", nargs="?", default=MOTION, help="profile .yaml or motion .csv")
    _add_robot(plan)
    _add_period(plan)
    plan.add_argument(
        "--margin", type=float, default=1.0, help="share of the motors' torque to use, in (0, 1]"
    )
    _add_out(plan, "CSV file for the motion")

    tune = _command(
        commands, "tune", _tune,
        "effective inertia along a motion, and the gains that follow",
        "sdt-drake tune --omega-r 65.991 --zeta 0.95 0.98 0.99 0.95",
    )  # fmt: skip
    tune.add_argument("motion", nargs="?", default=MOTION, help="profile .yaml or motion .csv")
    _add_robot(tune)
    _add_period(tune)
    _add_tuning(tune)

    step = _command(
        commands, "step", _step,
        "simulate the step response of one speed loop",
        "sdt-drake step --inertia 4.26 --structure p_in_feedback --zeta 0.95 --out step.png",
    )  # fmt: skip
    step.add_argument(
        "--inertia", type=float, default=4.26, help="effective inertia, motor side [kg m²]"
    )
    step.add_argument("--structure", default="p_in_feedback", help="pi or p_in_feedback")
    step.add_argument("--omega-r", type=float, default=paper.OMEGA_R, help=_OMEGA_R)
    step.add_argument("--zeta", type=float, default=1.0, help="damping ratio [-]")
    _add_out(step, "figure (.png, .svg, .pdf)")

    simulate = _command(
        commands, "simulate", _simulate,
        "run a scenario and show how well the joints follow",
        "sdt-drake simulate package://sdt/scenarios/coupled_pi_ctc.yaml --out run.csv",
    )  # fmt: skip
    _add_scenario(simulate)
    _add_out(simulate, "CSV file for the recording, or a figure of it (.png, .svg, .pdf)")

    diagram = _command(
        commands, "diagram", _diagram,
        "export the block diagram of a scenario's loop",
        "sdt-drake diagram package://sdt/scenarios/axis_pi_ctc.yaml --format svg --out loop.svg",
    )  # fmt: skip
    _add_scenario(diagram)
    diagram.add_argument("--format", help="dot, svg or png (default: by --out, or dot)")
    diagram.add_argument("--depth", type=int, default=1, help="levels of boxes to open")
    _add_out(diagram, "file; by default the scenario's name")
    return parser


_OMEGA_R = "lowest natural frequency of the structure [rad/s]"


def _command(commands, name: str, run: Callable, help_: str, example: str):
    parser = commands.add_parser(
        name,
        help=help_,
        description=f"{help_[0].upper()}{help_[1:]}.",
        epilog=f"example: {example}",
    )
    parser.set_defaults(command=run)
    return parser


def _add_out(parser, help_: str, default: str | None = None) -> None:
    note = f" (default: {default})" if default else ""
    parser.add_argument("--out", type=Path, default=default and Path(default), help=help_ + note)


def _add_robot(parser) -> None:
    parser.add_argument("--robot", default=ROBOT, help="SDF file (default: the shipped device)")


def _add_period(parser) -> None:
    parser.add_argument("--period", type=float, default=0.005, help="interpolation period [s]")


def _add_scenario(parser) -> None:
    parser.add_argument("scenario", metavar="SCENARIO.yaml")


def _add_tuning(parser) -> None:
    parser.add_argument("--omega-r", type=float, default=paper.OMEGA_R, help=_OMEGA_R)
    parser.add_argument(
        "--zeta", type=float, nargs="+", help="damping ratio at the largest inertia, each joint [-]"
    )


# --- the commands ----------------------------------------------------------------------------


def _reproduce(options: argparse.Namespace) -> None:
    import time

    from sdt_drake.analysis.report import write_study
    from sdt_drake.analysis.study import Stopwatch, run_study
    from sdt_drake.graphviz import NO_GRAPHVIZ, has_graphviz

    start = time.perf_counter()
    folder: Path = options.out
    folder.mkdir(parents=True, exist_ok=True)
    watch = Stopwatch(_say)
    study = run_study(watch)
    claims = write_study(study, folder, watch)
    _say()
    for claim in claims:
        _say(f"  {claim.id:29s} {claim.verdict}")
    if not has_graphviz():
        _say(f"\nNo .svg of the block diagrams: {NO_GRAPHVIZ}")
    _say(f"\n{folder / 'report.md'} written, {time.perf_counter() - start:.1f} s in all")


def _plan(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.design import load_plan
    from sdt_drake.robot import load_robot

    if options.out and options.out.suffix != ".csv":
        raise InputError(f"{options.out}: expected a .csv file")
    if not 0 < options.margin <= 1:
        raise InputError(f"--margin: {options.margin:g}, expected a share in (0, 1]")
    robot = load_robot(options.robot)
    plan = load_plan(options.motion, robot, period=options.period, margin=options.margin)
    motion = plan.motion
    _say(f"{options.motion}: {motion.duration:g} s, {len(motion.time)} samples, feasible")
    peak, use = np.abs(plan.torque).max(axis=0), plan.peak_use(robot)
    _print_table(
        ("joint", "peak torque [N m]", "of the motor [%]", "limited [s]", "speed [rad/s]",
         "from [deg]", "to [deg]"),
        [
            (
                f"{k + 1} {robot.joint_names[k]}", f"{peak[k]:.1f}",
                f"{100 * use[k]:.1f}",
                f"{plan.limited[:, k].sum() * motion.period:.3f}",
                f"{np.abs(motion.v[:, k]).max():.3f}",
                f"{np.degrees(motion.q[:, k].min()):.1f}",
                f"{np.degrees(motion.q[:, k].max()):.1f}",
            )
            for k in range(robot.n)
        ],
    )  # fmt: skip
    _say("torques are joint side, with the motors' inertia")
    if options.out:
        motion.to_csv(options.out)
        _say(f"{options.out} written")


def _tune(options: argparse.Namespace) -> None:
    from sdt_drake.control import damping_ratio, natural_frequency, oscillation_frequency
    from sdt_drake.design import make_design
    from sdt_drake.resources import find_file
    from sdt_drake.scenario import ControllerChoice, Scenario

    zeta = options.zeta
    if zeta is None and find_file(options.robot).resolve() == find_file(ROBOT).resolve():
        zeta = paper.table1("zeta_max")
    try:
        design = make_design(
            Scenario(
                robot=options.robot,
                motion=options.motion,
                period=options.period,
                controller=ControllerChoice(omega_r=options.omega_r, zeta=zeta),
            )
        )
    except InputError as error:
        # The fields of the scenario are options here.
        text = re.sub(r"(?:controller\.)?\b(zeta|omega_r|period)(?=:)", r"--\1", str(error))
        raise InputError(text.replace("--omega_r", "--omega-r")) from None
    inertia, gains = design.inertia, design.gains
    at = (inertia.maximum, inertia.median, inertia.minimum)
    oscillation = oscillation_frequency(gains, inertia.maximum)
    slowest, fastest = (
        natural_frequency(gains, values) / options.omega_r
        for values in (inertia.maximum, inertia.minimum)
    )
    _print_table(
        ("joint", "I_eff max", "median", "min [kg m²]", "var. [%]", "K_PS", "K_IS",
         "zeta at max", "median", "min", "omega_0", "omega_n/omega_r"),
        [
            (
                f"{k + 1} {design.robot.joint_names[k]}",
                *(f"{values[k]:.5g}" for values in at),
                f"{inertia.variation_percent[k]:.2f}",
                f"{gains.kp[k]:.4g}",
                f"{gains.ki[k]:.4g}",
                *(f"{damping_ratio(gains, values)[k]:.3f}" for values in at),
                f"{oscillation[k]:.2f}",
                f"{slowest[k]:.3f} to {fastest[k]:.3f}",
            )
            for k in range(design.robot.n)
        ],
    )  # fmt: skip
    _say("motor side; K_PS [N m s/rad], K_IS [N m/rad]; omega_0 [rad/s] at the largest inertia")
    too_fast = [str(k + 1) for k in range(design.robot.n) if fastest[k] > 0.5 * (1 + 1e-9)]
    if too_fast:
        _say(
            f"note: omega_n exceeds 0.5 omega_r where the inertia is small, joint "
            f"{', '.join(too_fast)}"
        )


def _step(options: argparse.Namespace) -> None:
    from dataclasses import asdict

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.study import step_response
    from sdt_drake.control import STRUCTURES
    from sdt_drake.errors import checked_choice

    checked_number(options.inertia, "--inertia", minimum=0, exclusive=True)
    checked_choice(options.structure, STRUCTURES, "--structure")
    if options.out:
        plots.checked_figure_path(options.out)
    step = step_response(options.structure, options.zeta, options.inertia, options.omega_r)
    units = {"overshoot_percent": "%", "peak": "rad/s", "steady_state_error": "rad/s"}
    for name, value in asdict(step.metrics).items():
        label = name.removesuffix("_percent").replace("_", " ")
        _say(f"{label:20s} {value:.5g} {units.get(name, 's')}")
    if options.out:
        figure = plots.step_responses("Step response", {step.structure: step})
        plots.save(figure, options.out)
        _say(f"{options.out} written")


def _simulate(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.tracking import track
    from sdt_drake.simulate import simulate

    if options.out and options.out.suffix != ".csv":
        plots.checked_figure_path(options.out)
    design = _design_of(options.scenario)
    scenario = design.scenario
    recording = simulate(design)
    tracking = track(recording, design.motion)
    _say(f"{scenario.name}: {scenario.controller.kind} on the {scenario.plant.kind} plant")
    _print_table(
        ("joint", "largest error [rad/s]", "RMS [rad/s]", "constant speed [rad/s]",
         "position [deg]", "saturated [%]"),
        [
            (
                f"{k + 1} {design.robot.joint_names[k]}",
                f"{tracking.max_abs_speed_error[k]:.4f}",
                f"{tracking.rms_speed_error[k]:.4f}",
                f"{tracking.constant_speed_error[k]:.4f}".replace("nan", "–"),
                f"{np.degrees(tracking.max_abs_position_error[k]):.3f}",
                f"{100 * tracking.saturated_fraction[k]:.2f}",
            )
            for k in range(design.robot.n)
        ],
    )  # fmt: skip
    if options.out is None:
        return
    if options.out.suffix == ".csv":
        recording.to_csv(options.out)
    else:
        label = {"pi": "PI", "pi_ctc": "PI + CTC"}.get(
            scenario.controller.kind, scenario.controller.kind
        )
        lines = plots.tracking_lines({label: recording}, "speed_error")
        names = design.robot.joint_names
        title = f"{scenario.name}: speed errors"
        figure = plots.speed_errors(title, recording.time, lines, names, design.motion)
        plots.save(figure, options.out)
    _say(f"{options.out} written")


def _design_of(path: str):
    """The design of a scenario file; errors name the file."""
    from sdt_drake.design import make_design
    from sdt_drake.scenario import load_scenario

    scenario = load_scenario(path)
    try:
        return make_design(scenario)
    except InputError as error:
        own = str(error).removeprefix(f"scenario '{scenario.name}': ")
        raise InputError(f"{path}: {own}" if own != str(error) else own) from None


def _diagram(options: argparse.Namespace) -> None:
    from sdt_drake.errors import checked_choice
    from sdt_drake.graphviz import FORMATS, write_diagram
    from sdt_drake.loops import make_loop

    suffix = options.out.suffix.removeprefix(".") if options.out else ""
    format_ = options.format or (suffix if suffix in FORMATS else "dot")
    checked_choice(format_, FORMATS, "--format")
    if suffix in FORMATS and suffix != format_:
        raise InputError(f"--format: {format_}, but {options.out} ends in .{suffix}")
    if not 1 <= options.depth <= 100:
        raise InputError(f"--depth: {options.depth}, expected 1 to 100")
    design = _design_of(options.scenario)
    name = re.sub(r"[^\w.-]+", "_", design.scenario.name).strip(".")
    path = options.out or Path(f"{name}.{format_}")
    loop = make_loop(design, boxed=True)
    write_diagram(loop, path, format_=format_, max_depth=options.depth)
    _say(f"{path} written")


def _print_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for cells in (header, *rows):
        first = cells[0].ljust(widths[0])
        _say("  ".join([first, *(c.rjust(w) for c, w in zip(cells[1:], widths[1:], strict=True))]))
