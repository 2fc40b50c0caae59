"""Loops whose reference or torque comes from outside."""

import numpy as np
import pytest
from helpers.variants import kind
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import PassThrough

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.run.controllers import make_controller
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import simulate

ONLINE = {"inverse_dynamics": "online"}
DEVICE = {
    "drive": Drive(period=0.001, torque_bandwidth=400.0),
    "plant.friction": Friction(viscous=[10.0] * 4),
}
LOADED = np.array([0.2, 0.8, 0.3, 0.4])


class Held(LeafSystem):
    """Samples of a motion at their instants; a hold of Drake would start with zeros."""

    def __init__(self, motion):
        super().__init__()
        self._motion = motion
        self.DeclareStateOutputPort("reference", self.DeclareDiscreteState(self._sample(0)))
        self.DeclarePeriodicDiscreteUpdateEvent(motion.period, 0.0, self._update)

    def _sample(self, i):
        return np.concatenate([self._motion.q[i], self._motion.v[i], self._motion.vd[i]])

    def _update(self, context, values):
        values.set_value(self._sample(round(context.get_time() / self._motion.period)))


def fed(design, motion=None):
    """A loop, and the diagram around it with a motion as its external reference."""
    builder, loop = DiagramBuilder(), make_loop(design, reference="external")
    builder.AddSystem(loop.diagram)
    held = builder.AddSystem(Held(motion or design.reference.held))
    builder.Connect(held.get_output_port(), loop.GetInputPort("reference"))
    return loop, builder.Build()


@pytest.mark.parametrize(("label", "fields"), [("pi", {}), ("p_pi+id", DEVICE)])
def test_planned_motion_from_outside_gives_the_same_run(designed, label, fields):
    design = designed("coupled_pi", kind(label) | ONLINE | fields, start=2.0, end=2.3)
    planned, external = simulate(design), simulate(*fed(design))
    for name in ("q", "v", "q_ref", "v_ref", "load_torque"):
        np.testing.assert_array_equal(getattr(external, name), getattr(planned, name), name)
    for name in ("tau", "tau_peak", "tau_rms", "tau_mean", "saturated"):  # of all periods
        own, wanted = getattr(external, name)[1:], getattr(planned, name)[1:]
        np.testing.assert_allclose(own, wanted, atol=1e-8, err_msg=name)


def test_reference_from_outside_is_neither_limited_nor_delayed(designed):
    """The yaw joint has 6.28 rad/s, and a motor for a part of these speeds."""
    t = np.linspace(0, 1, 101)
    motion = Motion.from_speeds(0.005, LOADED, np.outer(np.sin(np.pi * t) ** 2, [0, 0, 0, 12.0]))

    def made(delay):
        fields = kind("p_pi") | ONLINE | {"drive": Drive(reference_delay=delay)}
        return designed("coupled_pi", fields, motion=motion)

    design, late = made(0.0), made(0.0075)
    planned = simulate(design)
    assert planned.v_ref.max() > 6.2832 and planned.saturated[:, 3].mean() > 0.1
    for external in (simulate(*fed(design)), simulate(*fed(late))):
        for name in ("q", "v", "q_ref", "v_ref", "load_torque"):
            np.testing.assert_array_equal(getattr(external, name), getattr(planned, name), name)


@pytest.mark.parametrize(
    ("label", "speed", "encoder"),
    [("p_pi+id", 0.0, "motor"), ("pi_ctc", 0.7, "motor"), ("p_pi+id", 0.7, "link")],
)
def test_run_starts_from_given_angles_and_speeds(designed, label, speed, encoder):
    """Around the vertical axis of the first joint nothing changes with its angle."""
    springs = Elasticity([40.0] * 4, damping_ratio=0.02, encoder=encoder)
    fields = DEVICE | {"plant.elasticity": springs, "drive": Drive(torque_bandwidth=400.0)}
    design = designed("coupled_pi", kind(label) | ONLINE | fields, end=0.1)
    v = np.array([speed, 0, 0, 0])
    motion = Motion.from_speeds(0.005, LOADED, np.tile(v, (21, 1)))
    run = simulate(*fed(design, motion), q=LOADED, v=v)
    np.testing.assert_allclose(run.v, motion.v, atol=2e-5)
    np.testing.assert_array_equal(run.q_ref, motion.q)  # not that of the design
    assert np.abs(run.tau[0, 1]) > 30  # joint 2 carries a load


def test_outside_controller_equals_the_one_inside(designed):
    design = designed("coupled_pi", kind("pi") | DEVICE | {"drive": Drive()}, end=0.3)
    builder, loop = DiagramBuilder(), make_loop(design, controller="external")
    controller = builder.AddSystem(make_controller(design)[1])
    builder.AddSystem(loop.diagram)
    for name in ("reference", "measured"):
        builder.Connect(loop.diagram.GetOutputPort(name), controller.GetInputPort(name))
    builder.Connect(controller.get_output_port(), loop.GetInputPort("tau_cmd"))
    outside, inside = simulate(loop, builder.Build()), simulate(design)
    # Its integrals, which the start of the loop does not know, start at 0: so does the motion.
    assert np.abs(inside.tau_cmd[0]).max() < 1e-9
    np.testing.assert_allclose(outside.v, inside.v, atol=1e-9)
    np.testing.assert_allclose(outside.tau_rms[1:], inside.tau_rms[1:], rtol=1e-6, atol=1e-6)


TABLES = [
    (kind("p_pi+id"), "feedforward_table is computed along the planned motion"),
    (kind("pi_scheduled") | ONLINE, "inertia_table is computed along the planned motion"),
    (ONLINE | {"plant.kind": "axis"}, "the load of the axis plant is computed along the planned"),
]


@pytest.mark.parametrize("fields, message", TABLES, ids=[case[-1] for case in TABLES])
def test_option_that_needs_a_planned_motion_refuses_open_reference(designed, fields, message):
    with pytest.raises(InputError, match=f"^reference: 'external', but {message}"):
        make_loop(designed("coupled_pi", fields, end=0.1), reference="external")


CALLS = [
    (lambda design: make_loop(design, reference="outside"), "reference: 'outside', expected one o"),
    (lambda design: make_loop(design, controller="pi"), "controller: a str, expected a System"),
    (lambda design: simulate(make_loop(design, reference="external")), "reference: external, but"),
    (lambda design: simulate(make_loop(design, controller="external")), "tau_cmd: external, but n"),
    (lambda design: simulate(design, DiagramBuilder()), "diagram: a DiagramBuilder, expected"),
    (lambda design: simulate(design, PassThrough(1)), "diagram: a PassThrough, expected a Diagram"),
    (lambda design: simulate(design, around_nothing()), "diagram: .*, expected a diagram that con"),
    (lambda design: simulate(*fed(design, NOWHERE)), "reference: .*nan.* expected finite numbers"),
    (lambda design: simulate(design, q=np.zeros(3)), r"q: of shape \(3,\), expected \(4,\)"),
    (lambda design: simulate(design, v=[0, np.nan, 0, 0]), r"v\[1\]: nan, expected finite numbers"),
]
NOWHERE = Motion(0.005, *np.full((3, 21, 4), np.nan))


def around_nothing():
    builder = DiagramBuilder()
    builder.AddSystem(PassThrough(1))
    return builder.Build()


@pytest.mark.parametrize("call, message", CALLS, ids=[case[-1] for case in CALLS])
def test_wrong_call_of_make_loop_is_one_line(designed, call, message):
    with pytest.raises(InputError, match=f"^{message}") as error:
        call(designed("coupled_pi", ONLINE, end=0.1))
    assert "\n" not in str(error.value)
