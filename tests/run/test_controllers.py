"""The controllers alone: what they tell of themselves, and their systems against it."""

import numpy as np
import pytest
from alone import Alone
from pydrake.systems.framework import LeafSystem
from variants import overruled

from sdt_drake.analysis.comparison import compare, with_controller
from sdt_drake.analysis.linear import linear_feedback
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check
from sdt_drake.run.controllers import (
    Pi,
    make_controller,
    predicts_updates,
    register_controller,
)


class Mine(Pi):
    """A PI speed controller that takes a feedforward."""

    plants = ("coupled",)
    options = ("feedforward",)


def test_a_registered_controller_is_known_to_scenarios_and_comparisons(designed):
    base = designed("coupled_pi", end=0.2)
    with pytest.raises(InputError, match=r"controllers: 'mine', expected one of pi, "):
        compare(base, ["mine"])
    register_controller("mine", Mine)
    register_controller("mine", Mine)  # of a file that is run once more
    plain, fed, of_pi = compare(base, ["mine", "mine+id", "pi"])
    np.testing.assert_array_equal(plain.recording.v, of_pi.recording.v)
    assert plain.needs == of_pi.needs and len(fed.needs) > len(of_pi.needs)
    assert not np.array_equal(fed.recording.v, plain.recording.v)

    for name, controller, message in (
        ("a+b", Mine, "expected a name of letters"),
        ("pi", Mine, "'pi': ships with the package"),
        ("mine", LeafSystem, "expected a class that derives"),
    ):
        with pytest.raises(InputError, match=message):
            register_controller(name, controller)

    shipped, heir = (make_controller(made.design) for made in (of_pi, plain))
    assert predicts_updates(shipped) and not predicts_updates(heir)  # its law may be another

    scenario = with_controller(base.scenario, "mine")
    check(scenario)
    scenario.controller.anti_windup = True
    with pytest.raises(InputError, match=r"controller\.anti_windup: mine takes none, only pi, "):
        check(scenario)
    with pytest.raises(InputError, match=r"controller\.kind: mine needs plant\.kind coupled$"):
        designed("axis_pi", {"controller.kind": "mine"}, end=0.1)


WIRED = [
    ("pi_ctc", {}),
    ("pi_id", {}),
    ("p_pi", {"feedforward": "id", "position_gain": [2.0, 3.0, 4.0, 5.0]}),
    ("pi_scheduled", {}),
    ("pi_scheduled", {"feedforward": "ctc", "structure": "pi"}),
]


class Commanding(Alone):
    """A continuous controller's system, at a sample of its motion."""

    def __init__(self, design, i):
        super().__init__(make_controller(design))
        self.context.SetTime(i * design.motion.period)
        held, loads = design.reference, design.loads._asdict()
        self.give(**{name: torque[i] for name, torque in loads.items()})
        self.give(reference=[*held.q[i], *held.v[i], *held.vd[i]])

    def give(self, **inputs):
        super().give(**{k: v for k, v in inputs.items() if self.system.HasInputPort(k)})

    def command(self, q, v, integral=None):
        unread = np.full(4, 1e9)  # by any controller
        self.give(state=[*unread, *v], sampled_state=[*q, *unread])
        if self.context.num_discrete_state_groups():  # the tables
            self.sample()
        if integral is not None:
            self.context.SetContinuousState(integral)
        return self.output("tau_cmd")


def rests(commanding, motion, **inputs):
    """Check that the command of a start at rest is the given one."""
    tau_cmd = np.array([1.0, -2.0, 300.0, 0.5])
    commanding.system.rest(commanding.context, tau_cmd)
    commanding.give(**inputs)
    command = commanding.command(motion.q[0], motion.v[0])
    np.testing.assert_allclose(command, tau_cmd, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("kind", "choices"), WIRED, ids=str)
def test_command_after_updates_and_at_rest_is_that_of_the_system(designed, kind, choices):
    fields = {"controller.kind": kind} | {f"controller.{k}": v for k, v in choices.items()}
    design = designed("coupled_pi", fields, start=2.0, end=3.0, rest=2)
    rng = np.random.default_rng(3)
    measured = rng.normal(size=(4, 8)) + np.hstack([design.motion.q, design.motion.v])[97:101]
    held = np.array([97, 98, 99])
    before, after = [], []
    for i, (q_v, q_before) in enumerate(zip(measured[:3], measured[[0, 0, 1], :4], strict=True)):
        for commands, at, q in ((before, held[max(i - 1, 0)], q_before), (after, held[i], q_v[:4])):
            wired = Commanding(design, at)
            integral = np.ones(wired.context.num_continuous_states())
            commands.append(wired.command(q, q_v[4:], integral))
    told = wired.system.after_updates(np.array([*before, before[0]]), measured, held)
    np.testing.assert_allclose(told, after, rtol=1e-9, atol=1e-6)
    rests(Commanding(design, 0), design.motion)


@pytest.mark.parametrize(
    ("kind", "structure"), [("pi", "p_in_feedback"), ("pi", "pi"), ("p_pi", "p_in_feedback")]
)
def test_mean_speeds_of_the_periods_are_held_where_asked_for(designed, kind, structure):
    """Of a motion that accelerates; a run starts without an error of speed all the same."""
    fields = {"held_speed": "mean", "controller.kind": kind, "controller.structure": structure}
    design = designed("coupled_pi", fields, start=2.0, end=2.1)
    motion = design.motion
    mean = (motion.v[1:] + motion.v[:-1]) / 2
    np.testing.assert_allclose(design.reference.v, [*mean, motion.v[-1]], rtol=0, atol=1e-12)
    rests(Commanding(design, 0), motion, reference=[*motion.q[0], *motion.v[0], *np.zeros(4)])


def test_linear_gains_are_scheduled_with_the_inertia(designed):
    plain = designed("coupled_pi", end=0.1)
    share = np.array([0.5, 0.6, 0.7, 0.8])
    design = designed("coupled_pi", {"controller.kind": "pi_scheduled"}, end=0.1)
    design = overruled(design, inertia_share=np.tile(share, (len(design.motion.q), 1)))
    own, fixed = linear_feedback(design, 3), linear_feedback(plain, 3)
    np.testing.assert_allclose(own.C, share[:, None] * fixed.C, rtol=1e-12)
    np.testing.assert_allclose(own.D, share[:, None] * fixed.D, rtol=1e-12)
