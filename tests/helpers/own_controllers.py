"""A controller of your own, in a file that a scenario names as controller.file."""

from pydrake.systems.framework import LeafSystem

from sdt_drake.run.controllers import Controller, register_controller


class Proportional(LeafSystem, Controller):
    """tau_cmd = 0.9 K_PS (r v_ref - r v), motor side, at the samples of the reference."""

    needs = ("largest inertia of each joint",)

    def __init__(self, design):
        super().__init__()
        self._n = n = design.device.simulated.n
        self._gain = 0.9 * design.tuning.gains.kp * design.device.simulated.gear_ratio
        self._reference = self.DeclareVectorInputPort("reference", 3 * n)
        self._state = self.DeclareVectorInputPort("sampled_state", 2 * n)
        inputs = {self._reference.ticket(), self._state.ticket()}
        self.DeclareVectorOutputPort("tau_cmd", n, self._calc, inputs)

    def _calc(self, context, output):
        n = self._n
        v_ref, v = self._reference.Eval(context)[n : 2 * n], self._state.Eval(context)[n:]
        output.SetFromVector(self._gain * (v_ref - v))


register_controller("proportional", Proportional)
