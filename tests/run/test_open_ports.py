"""Loops whose reference or torque comes from outside."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from variants import kind

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
    """A diagram around the loop, with a motion as its external reference."""
    builder = DiagramBuilder()
    loop = builder.AddSystem(make_loop(design, reference="external"))
    held = builder.AddSystem(Held(motion or design.reference))
    builder.Connect(held.get_output_port(), loop.GetInputPort("reference"))
    return builder.Build()


@pytest.mark.parametrize(("label", "fields"), [("pi", {}), ("p_pi+id", DEVICE)])
def test_the_planned_motion_from_outside_gives_the_same_run(designed, label, fields):
    design = designed("coupled_pi", kind(label) | ONLINE | fields, start=2.0, end=2.3)
    planned, external = simulate(design), simulate(design, fed(design))
    for name in ("q", "v", "q_ref", "v_ref", "load_torque"):
        np.testing.assert_array_equal(getattr(external, name), getattr(planned, name), name)
    for name in ("tau", "tau_peak", "tau_rms", "tau_mean", "saturated"):  # of all periods
        own, wanted = getattr(external, name)[1:], getattr(planned, name)[1:]
        np.testing.assert_allclose(own, wanted, atol=1e-8, err_msg=name)


def test_errors_are_against_what_came_from_outside(designed):
    design = designed("coupled_pi", kind("p_pi+id") | ONLINE, start=2.0, end=2.3)
    motion = design.reference
    q = motion.q[:1] + 0.5 * (motion.q - motion.q[:1])
    other = Motion(motion.period, q, 0.5 * motion.v, 0.5 * motion.vd)
    run = simulate(design, fed(design, other), v=other.v[0])
    np.testing.assert_array_equal(run.v_ref, other.v)
    assert np.abs(run.position_error[-1]).max() < 0.1 * np.abs(run.q - motion.q)[-1].max()


def test_a_controller_outside_is_the_one_inside(designed):
    design = designed("coupled_pi", kind("pi") | DEVICE | {"drive": Drive()}, end=0.3)
    builder = DiagramBuilder()
    loop = builder.AddSystem(make_loop(design, controller="external"))
    controller = builder.AddSystem(make_controller(design))
    for name, signal in (("reference", "reference"), ("state", "measured")):
        builder.Connect(loop.GetOutputPort(signal), controller.GetInputPort(name))
    builder.Connect(controller.get_output_port(), loop.GetInputPort("tau_cmd"))
    outside, inside = simulate(design, builder.Build()), simulate(design)
    # Its integrals, which `rest` of the loop does not know, start at 0: so does the motion.
    assert np.abs(inside.tau_cmd[0]).max() < 1e-9
    np.testing.assert_allclose(outside.v, inside.v, atol=1e-9)
    np.testing.assert_allclose(outside.tau_rms[1:], inside.tau_rms[1:], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("label", ["p_pi+id", "pi_ctc"])
@pytest.mark.parametrize("speed", [0.0, 0.7])
@pytest.mark.parametrize("encoder", ["motor", "link"])
def test_a_run_starts_at_rest_from_given_angles_and_speeds(designed, label, speed, encoder):
    """Around the vertical axis of the first joint nothing changes with its angle."""
    springs = Elasticity([40.0] * 4, damping_ratio=0.02, encoder=encoder)
    fields = DEVICE | {"plant.elasticity": springs, "drive": Drive(torque_bandwidth=400.0)}
    design = designed("coupled_pi", kind(label) | ONLINE | fields, end=0.1)
    v = np.array([speed, 0, 0, 0])
    motion = Motion.from_speeds(0.005, LOADED, np.tile(v, (21, 1)))
    run = simulate(design, fed(design, motion), q=LOADED, v=v)
    np.testing.assert_allclose(run.v, np.tile(v, (21, 1)), atol=2e-5)
    assert np.abs(run.tau[0, 1]) > 30  # joint 2 carries a load


def test_bad_calls_are_refused(designed):
    """Among them those of what is known along a planned motion alone."""
    for fields, message in (
        (kind("p_pi+id"), "reference: 'external', but feedforward_table is computed along the"),
        (kind("pi_scheduled") | ONLINE, "reference: 'external', but inertia_table is computed"),
        (ONLINE | {"plant.kind": "axis"}, "reference: 'external', but the load of the axis plan"),
    ):
        with pytest.raises(InputError, match=message):
            make_loop(designed("coupled_pi", fields, end=0.1), reference="external")
    design = designed("coupled_pi", ONLINE, end=0.1)
    with pytest.raises(InputError, match="reference: 'outside', expected one of planned, external"):
        make_loop(design, reference="outside")
    with pytest.raises(InputError, match=r"^controller: a str, expected a System"):
        make_loop(design, controller="pi")
    for choice, port in (("reference", "reference"), ("controller", "tau_cmd")):
        loop = make_loop(design, **{choice: "external"})
        with pytest.raises(InputError, match=f"^{port}: external, but nothing is connected, exp"):
            simulate(design, loop)
    nowhere = Motion(0.005, *np.full((3, 21, 4), np.nan))
    with pytest.raises(InputError, match=r"reference: .*nan"):
        simulate(design, fed(design, nowhere))
    with pytest.raises(InputError, match=r"q: of shape \(3,\), expected \(4,\)"):
        simulate(design, q=np.zeros(3))
    with pytest.raises(InputError, match=r"v\[1\]: nan, expected finite numbers"):
        simulate(design, v=[0, np.nan, 0, 0])
