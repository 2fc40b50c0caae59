"""How the loops are wired, what can be put into them, and what they can be built into."""

import numpy as np
import pytest

from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Friction
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import simulate
from sdt_drake.systems.wiring import blocks_of

FRICTION = Friction([300.0, 60.0, 10.0, 20.0], [40.0, 0.0, 8.0, 2.0])
REAL = Drive(period=0.001, torque_bandwidth=300.0, n1=[150.0, 4, 4, 4], n0=[210.0, 5, 6, 7])

DISTURBED = {"disturbance.amplitude": 0.05}
WRONG = {
    "controller.model": Deviation(payload_mass=-40.0),
    "controller.friction_compensation": True,
    "controller.feedforward_gain": [1.1, 1, 0.9, 0],
    "plant.friction": FRICTION,
}
ONLINE = {"inverse_dynamics": "online"}
WIRINGS = [
    ("axis_pi_ctc", {}),
    ("axis_pi_ctc", ONLINE | {"controller.structure": "pi"}),
    ("coupled_pi", {"controller.kind": "inverse_dynamics"}),
    ("coupled_pi", {"controller.kind": "p_pi", "controller.feedforward": "id", "drive": REAL}),
    ("coupled_pi", {"controller.kind": "pi_scheduled", "plant.friction": FRICTION}),
    ("coupled_pi_ctc", DISTURBED),
    ("coupled_pi_ctc", ONLINE),
]


def test_a_loop_has_the_blocks_that_its_scenario_asks_for(designed, data_regression):
    """Drake's own blocks, but for the torques on line, which are called once per sample."""
    found = {}
    for number, (name, fields) in enumerate(WIRINGS):
        loop = make_loop(designed(name, fields, end=0.1))
        own = [s for s in blocks_of(loop) if not type(s).__module__.startswith("pydrake.")]
        assert [s.get_name() for s in own] == ["load_torque"] * ("inverse_dynamics" in fields)
        inputs = [loop.get_input_port(i).get_name() for i in range(loop.num_input_ports())]
        outputs = [loop.get_output_port(i).get_name() for i in range(loop.num_output_ports())]
        blocks = sorted(system.get_name() for system in loop.GetSystems())
        parts = {"blocks": blocks, "inputs": inputs, "outputs": outputs}
        found[f"{number} {loop.get_name()}"] = {k: " ".join(v) for k, v in parts.items()}
    data_regression.check(found)


@pytest.mark.parametrize(("name", "fields"), [w for w in WIRINGS if "online" not in w[1].values()])
def test_loops_without_python_convert_to_autodiff(designed, name, fields):
    """And have the same derivatives there; the state is small, so that no motor saturates."""
    diagram = make_loop(designed(name, fields, start=8, end=8.1))
    converted = diagram.ToAutoDiffXd()
    context, own = converted.CreateDefaultContext(), diagram.CreateDefaultContext()
    state = np.random.default_rng(3).normal(size=own.num_continuous_states()) * 1e-4
    own.SetContinuousState(state)
    context.SetTimeStateAndParametersFrom(own)
    derivatives = converted.EvalTimeDerivatives(context).CopyToVector()
    expected = diagram.EvalTimeDerivatives(own).CopyToVector()
    np.testing.assert_allclose([d.value() for d in derivatives], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("axis_pi_ctc", {"algorithm": "printed"}),
        ("coupled_pi_ctc", WRONG),
        ("coupled_pi", WRONG | {"controller.kind": "pi_id"}),
    ],
    ids=str,
)
def test_table_and_online_torques_are_the_same(designed, name, fields):
    table, online = (
        simulate(designed(name, fields | how, start=2.0, end=2.5)) for how in ({}, ONLINE)
    )
    for signal in ("v", "tau", "tau_cmd", "load_torque"):
        own, wanted = getattr(online, signal), getattr(table, signal)
        np.testing.assert_allclose(own, wanted, rtol=1e-9, atol=1e-8, err_msg=signal)
