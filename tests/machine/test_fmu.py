"""Loops as FMUs, which FMPy runs, beside the same loops run here."""

import sys
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from helpers.command_line import SHORT
from helpers.variants import kind, overruled
from oracles.fmu_player import PERIOD, running
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.io.errors import InputError
from sdt_drake.machine.fmu import write_fmu
from sdt_drake.pilot.head import head_motion
from sdt_drake.robot.device import Friction
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import simulate

ONLINE = kind("p_pi+id") | {"inverse_dynamics": "online"}


@pytest.fixture(scope="module")
def by_reference(designed, tmp_path_factory):
    """A design, and its loop as an FMU."""
    design = designed("coupled_pi", ONLINE)
    path = tmp_path_factory.mktemp("fmu") / "loop.fmu"
    write_fmu(design, path, "reference")
    return design, path


@pytest.mark.oracle
def test_fmu_runs_ten_seconds_as_the_direct_loop(by_reference):
    """Times of samples that are added up in place of multiplied are off late in the motion."""
    design, path = by_reference
    motion, direct = design.reference.held, simulate(design)
    with running(path) as fmu:
        fmu.begin()
        for i in range(2001):
            np.testing.assert_allclose(fmu.get("v"), direct.v[i], atol=1e-9)
            if i == 1500:
                q, v = direct.q[i : i + 1], direct.v[i : i + 1]
                rate = head_motion(design.device.simulated, q, v, 0 * v).angular_velocity[0]
                np.testing.assert_allclose(fmu.get("angular_rate"), rate, atol=1e-9)
            for name, values in (("q_ref", motion.q), ("v_ref", motion.v), ("vd_ref", motion.vd)):
                fmu.put(name, values[i])
            fmu.step()
        np.testing.assert_allclose(fmu.get("tau"), direct.tau[2001], atol=1e-6)
        assert np.linalg.norm(fmu.get("specific_force")) > 9


def test_fmu_parameters_and_start_act_as_in_a_direct_loop(designed, tmp_path):
    """Three instances at a time: as exported, without friction, and with other parameters."""

    def made(payload=0.0, **friction):
        fields = {"plant.friction": Friction(**friction), "plant.deviation.payload_mass": payload}
        return designed("coupled_pi", fields, end=0.3)

    viscous, coulomb = np.array([[100.0, 10.0, 0.0, 10.0], [270.0, 80.0, 0.0, 43.0]])
    stuck = {"coulomb": coulomb.tolist(), "breakaway": (1.5 * coulomb + 5).tolist()}
    design = made(viscous=viscous.tolist(), **stuck)
    write_fmu(design, tmp_path / "loop.fmu")
    # Breakaway changes in proportion to Coulomb, of joint 3 it is 5 N m.
    less = {"coulomb": [135.0, 80.0, 2.0, 0.0], "breakaway": [205.0, 125.0, 5.0, 0.0]}
    changed = made(20.0, viscous=[50.0, 20.0, 20.0, 10.0], **less)
    smooth = made(breakaway=[0.0, 0.0, 5.0, 0.0])
    start, tau = np.array([0.3, 0.5, -0.2, 0.1]), np.array([50.0, 900.0, 100.0, 10.0])

    def here(own):
        builder = DiagramBuilder()
        loop = make_loop(own, controller="external")
        builder.AddSystem(loop.diagram)
        source = builder.AddSystem(ConstantVectorSource(tau))
        builder.Connect(source.get_output_port(), loop.GetInputPort("tau_cmd"))
        return simulate(loop, builder.Build(), q=start).q[50]

    other = {
        name: changed.scenario.plant.friction.__dict__[name] for name in ("viscous", "coulomb")
    }
    parameters = {
        design: {},
        smooth: {"viscous_friction": [0.0] * 4, "coulomb_friction": [0.0] * 4},
        changed: {"payload_mass": [20.0]} | {f"{k}_friction": x for k, x in other.items()},
    }
    with ExitStack() as stack:
        fmus = [stack.enter_context(running(tmp_path / "loop.fmu")) for _ in parameters]
        for fmu, given in zip(fmus, parameters.values(), strict=True):
            fmu.begin(q_start=start, tau_cmd=tau, **given)
        for fmu in 25 * fmus:
            fmu.step(2 * PERIOD)
        found = np.array([fmu.get("q") for fmu in fmus])
    np.testing.assert_allclose(found, [here(own) for own in parameters], atol=1e-6)
    assert np.abs(np.diff(found, axis=0)).max(axis=1).min() > 1e-3


@pytest.fixture(scope="module")
def short(designed, tmp_path_factory):
    """The same loop with a motion of 0.5 s, as an FMU."""
    folder = tmp_path_factory.mktemp("short")
    (folder / "short.yaml").write_text(SHORT)
    fields = ONLINE | {"motion": str(folder / "short.yaml")}
    write_fmu(designed("coupled_pi", fields, end=0.5), folder / "loop.fmu", "reference")
    return folder / "loop.fmu"


def test_a_step_with_a_bad_number_is_an_error_with_a_text_and_the_fmu_goes_on(short, capfd):
    """Simulators take a step that PythonFMU discards for the end of the motion."""
    with running(short) as fmu:
        fmu.begin()
        fmu.put("q_ref", [np.nan] * 4)
        with pytest.raises(FMICallException, match=r"fmi2DoStep failed .*fatal"):
            fmu.step()
        text = "loop: q_ref: [nan, nan, nan, nan], expected finite numbers"
        assert text in capfd.readouterr().err
        fmu.put("q_ref", np.zeros(4))
        fmu.step()


def test_an_fmu_takes_steps_of_any_size(short):
    """A simulation by another simulator's steps passes through the same states."""
    ends = []
    for step in (PERIOD, 0.003, 0.0004):
        with running(short) as fmu:
            fmu.begin(q_start=[0.0, 0.2, 0.0, 0.0])
            for _ in range(round(0.06 / step)):
                fmu.step(step)
            ends.append(np.concatenate([fmu.get(name) for name in ("q", "v", "tau")]))
    assert np.abs(ends[0][4:8]).max() > 0.1
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, rtol=1e-4, atol=1e-8)


def test_the_description_is_valid(short):
    """An independent check of FMPy against the standard."""
    assert validate_fmu(short) == []


def test_instances_leave_the_references_of_the_script_as_they_are(short):
    """The loader releases one that it does not own; the second instance would end Python."""
    counts = []
    for _ in range(4):
        with running(short):
            counts.append(sys.getrefcount(vars(sys.modules["sdt_drake_loop"])))
    assert len(set(counts)) == 1


@pytest.mark.parametrize(
    "start, parameters, text",
    [
        (1.0, {}, "start time 1 s, expected 0"),
        (0.0, {"viscous_friction": [-1.0] * 4}, "viscous[1]: -1.0, expected a number >= 0"),
        (0.0, {"payload_mass": [np.nan]}, "payload_mass: [nan], expected finite numbers"),
    ],
)
def test_an_fmu_does_not_begin_with_bad_numbers(short, capfd, start, parameters, text):
    with running(short) as fmu, pytest.raises(FMICallException, match=r"failed .*fatal"):
        fmu.begin(start, **parameters)
    assert text in capfd.readouterr().err


def test_a_loop_that_cannot_be_an_fmu_is_refused(designed, tmp_path):
    """Its torques are known along the planned motion alone; its controller is a file of Python."""
    design = designed("coupled_pi", kind("p_pi+id"), end=0.1)
    with pytest.raises(InputError, match=r"^reference: 'external', but feedforward_table is"):
        write_fmu(design, tmp_path / "loop.fmu", "reference")
    with pytest.raises(InputError, match=r"^inputs: 'speed', expected one of torque, reference"):
        write_fmu(design, tmp_path / "loop.fmu", "speed")
    own = overruled(design.scenario.controller, file="own.py")
    own = replace(design, scenario=overruled(design.scenario, controller=own))
    with pytest.raises(InputError, match=r"controller\.file: own\.py, but an FMU runs no such"):
        write_fmu(own, tmp_path / "loop.fmu")
    assert not any(tmp_path.iterdir())
