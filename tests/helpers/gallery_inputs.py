"""Cheap inputs of the figures and reports in the gallery."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from helpers.known_truth import recorded_of, true_robot
from helpers.synthetic import make_table
from helpers.variants import kind, recorded
from sdt_drake.analysis.budget import ErrorBudget
from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse
from sdt_drake.analysis.linear import LinearLoop
from sdt_drake.analysis.loop_step import step
from sdt_drake.analysis.stability import StabilitySweep
from sdt_drake.analysis.step import StepResponse, step_metrics
from sdt_drake.analysis.tracking import MotorUse, Tracking, track_head
from sdt_drake.machine.cueing.candidate import Candidate as FlightCandidate
from sdt_drake.machine.cueing.candidate import percept_of
from sdt_drake.machine.cueing.flight import make_flight
from sdt_drake.machine.cueing.objective import objective
from sdt_drake.machine.cueing.result import CueingResult
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.learn.filter import Bandwidth, Convergence, LearningFilter
from sdt_drake.machine.learn.loops import LoopSet
from sdt_drake.machine.learn.trials import LearningResult, Step, Trial
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.machine.replay import ALONE, AS_IT_IS, FED, FEEDFORWARD, Replay
from sdt_drake.motion import Motion, Plan, margins
from sdt_drake.pilot.observer import load_perception
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import DeviceChoice, as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.sizing import Candidate, Requirements, Sizing
from sdt_drake.studies.verdicts import Verdict
from sdt_drake.systems.gains import STRUCTURES
from sdt_drake.systems.state_space import StateSpace

PERIOD, NAMES = 0.01, ("base", "elbow", "wrist")
DRIVE = {"drive.n1": [150.0, 0.5, 0.05, 0.05], "drive.n0": [300.0, 4.0, 0.5, 0.5]}
ROBOT = object.__new__(Robot)
vars(ROBOT).update(motor_torque_limit=np.array([5.0, 6.0, 7.0]), joint_names=NAMES)
FAMILIES = ("max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "felt_share")
COLUMNS = ("omega_r", "payload", "friction", "motion")
SIZING = Sizing(
    name="small",
    scenario="base.yaml",
    device=DeviceChoice(fitted=["AC-203", "TM-3950"]),
    motors=[["AC-150", "AC-203"], ["TM-2860", "TM-3950"]],
    structure_scales=[1.0],
    motions=["leans", "reference"],
    controllers=["pi", "pi_id"],
    requirements=Requirements([0.1, 0.2], [3.0]),
)


def waves(count, n, *, period=PERIOD, size=0.3):
    """Speeds of sines from rest, another frequency and size in each joint."""
    t = period * np.arange(count)[:, None]
    k = np.arange(1, n + 1)
    return size * np.sin(0.9 * k * t) * np.minimum(t, 1) / k


class Inputs:
    """What figures and reports are made of: cheap, and each made when it is first needed."""

    def __init__(self, designed, robot):
        self.designed, self.robot = designed, robot

    @cached_property
    def ran(self):
        """Joints that are to move at once, and saturate: design and recording."""
        design = self.designed("axis_pi", DRIVE, start=8.9, end=9.5, rest=20)
        return design, simulate(design)

    @cached_property
    def stepped(self):
        """A motor that saturates at first."""
        design = self.designed("axis_pi", {"controller.setpoint_weight": 1}, end=0.2)
        return step(design, joint=2, size=0.8, duration=0.15)

    @cached_property
    def calm(self):
        """A cascade that has no trouble, and a 3D recording."""
        design = self.designed("coupled_pi", kind("p_pi"), end=0.2)
        return design, simulate(design)

    @cached_property
    def head(self):
        """Times, and the tracking of the pilot's head by a device that does 99 %."""
        motion = Motion.from_speeds(0.02, np.zeros(4), waves(600, 4, period=0.02, size=0.5))
        run = recorded(motion, q=0.99 * motion.q, v=0.99 * motion.v)
        return motion.time, track_head(run, self.robot)

    @cached_property
    def motion(self):
        t = np.arange(301) * PERIOD
        v = np.stack([np.full_like(t, 0.5), np.zeros_like(t), 0.1 * t**2], axis=1)
        return Motion.from_speeds(PERIOD, np.array([0.0, 0.2, 0.4]), v)

    @cached_property
    def runs(self):
        def run(error):
            torque = np.cumsum(np.ones_like(self.motion.v), axis=0) / 100
            torques = {"tau_cmd": torque, "tau": torque / 2, "load_torque": -torque}
            return recorded(self.motion, v=self.motion.v + error, **torques)

        errors = {"pi": -0.123, "pi_ctc": np.array([0.011, -0.022, 0.033]), "pi_ctc, own": 0.4}
        return {label: run(error) for label, error in errors.items()}

    @cached_property
    def steps(self):
        t = np.linspace(0, 0.5, 1001)
        speed = {"pi": 1 - np.exp(-30 * t) * np.cos(40 * t), "p_in_feedback": 1 - np.exp(-20 * t)}
        return {
            name: StepResponse(
                b, zeta, t, speed[name], step_metrics(t, speed[name], y0=0, y_final=1)
            )
            for (name, b), zeta in zip(STRUCTURES.items(), (1.0, 0.95), strict=True)
        }

    @cached_property
    def budget(self):
        t = self.motion.time[:, None] * np.array([1.0, 2.0, 3.0])
        parts = {"reference lag": -0.2 * t, "load": 0.1 * t, "disturbance": 0 * t}
        remainder = 0.01 * np.sin(t)
        return ErrorBudget(self.motion.time, sum(parts.values()) + remainder, parts, remainder)

    @cached_property
    def response(self):
        """Loops omega_c / s of three joints."""
        omega = np.geomspace(0.01, 1000, 200)
        gain = np.array([5.0, 10.0, 20.0]) / (1j * omega[:, None])
        row, crossover = np.ones(3), np.array([5.0, 10.0, 20.0])
        found = (90 * row, np.array([np.inf, 2.0, np.inf]), 0 * row, row)
        found = (crossover, row, row, crossover, *found, row, row > 0, row)
        # v' = tau, tau = omega_c (v_ref - v); inputs tau, references and tau_ff.
        one, none, K = np.eye(3), np.zeros((3, 3)), np.diag(crossover)
        C, D = np.vstack([none, one, none, one, -K]), np.zeros((15, 15))
        D[12:, 6:9] = K
        opened = StateSpace(none, np.hstack([one, none, none, none, one]), C, D)
        coupled = LinearLoop(opened, False, 3)
        return FrequencyResponse(omega, gain / (1 + gain), gain, *found, coupled=coupled)

    @cached_property
    def sweeps(self):
        """By place of the encoder and drive; no loop is stable with the last drive."""
        ratio = np.linspace(0.1, 1.5, 15)
        made = {}
        for encoder, start in (("motor", 0.9), ("link", 0.3), ("wrong link", -1)):
            made[encoder] = {}
            for drive, slope in (("ideal drive", 0.2), ("the scenario's drive", 0.4)):
                damping = start - slope * ratio[:, None] * np.array([1.0, 1.2, 1.4])
                overshoot = np.where(damping > 0, 30 * (1 - damping), np.nan)
                made[encoder][drive] = StabilitySweep(ratio, damping, overshoot, np.ones(3))
        return made

    def compared(self, shares, *, head=True):
        """Controllers whose errors are shares; the second joint has no constant speed."""
        plant, made = SimpleNamespace(HasFrameNamed=lambda name: head), []
        design = SimpleNamespace(
            device=SimpleNamespace(simulated=SimpleNamespace(joint_names=NAMES, plant=plant))
        )
        for label, share in zip(("pi", "p_pi+id", "inverse_dynamics"), shares, strict=True):
            row = share * np.array([0.1, 0.2, 0.3])
            constant = share * np.array([0.02, np.nan, 0.04])
            felt, from_angles = SimpleNamespace(share=share), SimpleNamespace(share=share / 3)
            made.append(Compared(label, design, None))
            vars(made[-1]).update(  # as if computed already
                tracking=Tracking(row, row / 3, constant, 0 * row, np.radians(row)),
                motors=MotorUse(row, row, 2 * row, row),
                head=SimpleNamespace(felt=felt, felt_from_angles=from_angles),
            )
        return made

    @cached_property
    def planned(self):
        """The robot with slow motors, a plan and its margins; joint 2 is held back."""
        v = waves(400, 4)
        motion = Motion.from_speeds(PERIOD, np.zeros(4), v)
        limited = np.zeros(v.shape, dtype=bool)
        limited[100:150, 1] = True
        asked = Motion.from_speeds(PERIOD, np.zeros(4), v * np.where(limited, 1.2, 1.0))
        robot = as_driven(self.robot, Drive(n1=[80, 0.8, 1, 1], n0=[250, 3, 3, 3]))
        found = margins(robot, motion)
        return robot, Plan(motion, found.torque, limited, 0.8, asked), found

    @cached_property
    def table(self):
        return make_table(60, joints=2)

    @cached_property
    def verdicts(self):
        made = []
        sets = [(a, b) for a in SIZING.motors[0] for b in SIZING.motors[1]]
        for label in SIZING.controllers:
            for i, motors in enumerate(sets):
                error = (0.5 if label == "pi" else 0.3) / (1 + i)
                used = {"max_abs_speed_error_2": error / 0.2, "used_torque_share_1": 0.95 - 0.1 * i}
                worst = {"max_abs_speed_error_2": (error, "leans")}
                worst["used_torque_share_1"] = (0.95 - 0.1 * i, "reference")
                beyond = ("max_abs_speed_error_2",) * (error > 0.2)
                missed = (f"largest speed error of joint 2 is {error:.3g} rad/s",) * (error > 0.2)
                candidate, mass = Candidate(motors, 1.0), 180.0 + 10 * i
                made.append(
                    Verdict(candidate, label, mass, error, worst, used, missed, beyond, True)
                )
        return made

    @cached_property
    def replay(self):
        """A recording of the saturated run, of which the simulation has most."""
        design, run = self.ran
        measured = {"speed_error": run.speed_error, "torque": run.tau}
        measured["position_error"] = run.position_error
        as_it_is = {name: 0.9 * values for name, values in measured.items()}
        courses = {AS_IT_IS: as_it_is}
        courses["without friction"] = {name: 0.95 * v for name, v in measured.items()}
        courses[FEEDFORWARD] = {"torque": measured["torque"] * [0.99, 0.5, 0.5, -1]}
        courses[FED] = {name: (v + 3 * measured[name]) / 4 for name, v in as_it_is.items()}
        courses[ALONE] = {"torque": measured["torque"] * [0.99, 1, -1, 1]}
        signals = {"q": run.q, "v": run.v, "tau": run.tau * design.device.simulated.gear_ratio}
        signals |= {"q_ref": run.q_ref, "v_ref": run.v_ref}
        made = Recorded(Path("run.csv"), run.time, signals)
        return Replay(design, made, measured, np.radians([0.1, 0, 0, 0]), courses)

    @cached_property
    def found(self):
        """The identified device, of two recordings."""
        true = true_robot(self.robot)
        first, other = (recorded_of(true, seed=seed, seconds=12.0) for seed in (0, 1))
        other = replace(other, path=Path("other.csv"), signals={
            name: 1.02 * values for name, values in other.signals.items()
        })  # fmt: skip
        return identify(self.robot, [first, other], cutoff=3.0)

    @cached_property
    def learned(self):
        """Design, filter, checks and three flights, the last of them stopped."""
        design, n = self.calm[0], 4
        omega = np.geomspace(0.5, 300, 40)
        cut = tuple(Bandwidth(10.0 * k, "as given") for k in range(1, n + 1))
        ones = np.ones((len(omega), n), dtype=complex)
        filter_ = LearningFilter(omega, ones, ones[:, :, None] * ones[:, None], cut, 0 * omega[:n],
                                 0.005, "reference")  # fmt: skip
        sets = [LoopSet("the model", (), np.full((1, n), 0.4)),
                LoopSet("the devices", (), np.linspace(0.3, 0.7, 2 * n).reshape(2, n))]  # fmt: skip
        share = np.minimum(0.9, omega[:, None] / 300 * np.arange(1, n + 1) / n)
        checks = [Convergence(one, share * (i + 1) / 2, share.max(axis=1) * (i + 1) / 2)
                  for i, one in enumerate(sets)]  # fmt: skip
        t, flights = design.reference.planned.time[:, None], []
        for number, size in enumerate((0.01, 0.003, 0.004), 1):
            error = size * np.sin(30 * t * np.arange(1, n + 1)) * np.arange(1, n + 1)
            largest, rms = np.abs(error).max(axis=0), np.sqrt(np.mean(error**2, axis=0))
            peak, felt = 0.5 + 10 * size * np.arange(n), 30 * size
            flights.append(Trial(number, None, error, error, largest, rms, felt, peak, 0 * peak))
        result = LearningResult(
            tuple(flights),
            (Step(None, 0.5, "torque of joint 2"), Step(None, 1.0, "")),
            "the errors grow",
        )
        return design, filter_, checks, result

    @cached_property
    def flown(self):
        """A flight of banked turns, and five motions that come near it."""
        t = 0.02 * np.arange(200)
        force = np.stack([np.sin(t), 0.5 * np.cos(t), 9.81 + 5 * np.sin(0.8 * t) ** 2], axis=1)
        rate = np.stack([0.3 * np.cos(t), 0.1 * np.sin(2 * t), 0.05 + 0 * t], axis=1)
        attitude = np.stack([0.5 * np.sin(0.8 * t), 0.1 * np.cos(t)], axis=1)
        flight, model = make_flight(t, force, rate, "turn", attitude), load_perception("slow_yaw")

        def option(name, size):
            motion = Motion.from_speeds(0.02, np.zeros(4), waves(300, 4, period=0.02, size=size))
            return FlightCandidate(name, self.robot, motion, flight, 1.0, model)

        sizes = {"this motion": 0.1, "at rest": 0.0, "alignment": 0.2, "classical washout": 0.3}
        sizes |= {"no limits": 0.15}
        options = [option(name, size) for name, size in sizes.items()]
        rows = [{"sense": s, "seat_deg": 90.0, "g_error_rms": 0.1 + k, "cost": 2.0 + k,
                 "felt_rotation_rms_deg_s": 7.0 - k, "felt_vertical_rms_deg": None,
                 "reason": "the arm turns the other way" * k, "origin": "search"}
                for k, s in enumerate((1, -1))]  # fmt: skip
        numbers = {
            "starts": rows,
            "front": [{"g_weight": float(k), **row} for k, row in enumerate(rows)],
            "weights": {"g": 0.1, "vertical": 1.0, "acceleration": 0.1},
            "torque_share_allowed": 0.9,
            "flight_starts_at": 1.0,
        }
        numbers |= {"perception": model.source, "interrupted": True}
        front = ((0.5, options[1]), (1.0, options[0]))
        felt = percept_of(model, t, force, rate)
        numbers["objective"] = objective(options[0])
        return CueingResult(*options, front, felt, numbers)
