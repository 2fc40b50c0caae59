"""Loops as FMUs, which FMPy runs, beside the same loops run here."""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
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


def test_a_bad_step_is_an_error_with_a_text_and_the_fmu_goes_on(short, capfd):
    with running(short) as fmu:
        fmu.begin()
        for name, value, period, text in (
            ("q_ref", np.nan, PERIOD, "q_ref: [nan, nan, nan, nan], expected finite numbers"),
            (
                "vd_ref",
                0.0,
                0.003,
                "step size: 0.003 s is not a whole multiple of the period 0.005",
            ),
        ):
            fmu.put(name, [value] * 4)
            with pytest.raises(Exception, match="fmi2DoStep failed"):
                fmu.step(period)
            assert text in capfd.readouterr().out
            fmu.put(name, np.zeros(4))
        fmu.step()


@pytest.mark.parametrize(
    "start, parameters, text",
    [
        (1.0, {}, "start time 1 s, expected 0"),
        (0.0, {"viscous_friction": [-1.0] * 4}, "viscous[1]: -1.0, expected a number >= 0"),
        (0.0, {"payload_mass": [np.nan]}, "payload_mass: [nan], expected finite numbers"),
    ],
)
def test_an_fmu_that_begins_with_bad_numbers_makes_no_step(short, capfd, start, parameters, text):
    with running(short) as fmu:
        fmu.begin(start, **parameters)
        with pytest.raises(Exception, match="fmi2DoStep failed"):
            fmu.step()
    assert text in capfd.readouterr().out


def test_a_loop_that_cannot_be_an_fmu_is_refused(designed, tmp_path):
    """Its torques are known along the planned motion alone; its controller is a file of Python."""
    design = designed("coupled_pi", kind("p_pi+id"), end=0.1)
    with pytest.raises(InputError, match=r"^reference: 'external', but feedforward_table is"):
        write_fmu(design, tmp_path / "loop.fmu", "reference")
    with pytest.raises(InputError, match=r"^inputs: 'speed', expected one of torque, reference"):
        write_fmu(design, tmp_path / "loop.fmu", "speed")
    own = overruled(design.scenario.controller, file="own.py")
    own = replace(design, scenario=overruled(design.scenario, controller=own))
    with pytest.raises(
        InputError, match=r"controller\.file: own\.py, but an FMU runs no such code"
    ):
        write_fmu(own, tmp_path / "loop.fmu")
    assert not any(tmp_path.iterdir())
