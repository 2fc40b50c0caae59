"""PI speed controllers whose gains follow the inertia along the motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sdt_drake.arrays import Array, Index
from sdt_drake.control import SpeedGains
from sdt_drake.controllers.base import add_table
from sdt_drake.controllers.pi import Pi
from sdt_drake.systems import GainSchedule, Wiring

if TYPE_CHECKING:
    from sdt_drake.design import Design


class PiScheduled(Pi):
    """K_PS and K_IS in proportion to I_eff(q_ref).

    .. pydrake_system::

        name: PiScheduled
        input_ports:
        - reference
        - state
        output_ports:
        - tau_cmd
    """

    needs = ("inertia along the motion",)
    options = ("anti_windup", "feedforward")

    @classmethod
    def in_words(cls, design: Design) -> str:
        return f"{super().in_words(design)}, their gains those at the largest inertia"

    def _gains(self, at: int | None) -> SpeedGains:
        gains = self._design.gains
        share = 1.0 if at is None else self._design.inertia_share[at]
        return SpeedGains(kp=share * gains.kp, ki=share * gains.ki)

    def _add_ahead(self, wiring: Wiring, at: int | None) -> dict[str, str]:
        if at is not None:  # Drake linearises no schedule of a sampled controller
            return {}
        add_table(wiring, "inertia_table", self._design, inertia_share=self._design.inertia_share)
        wiring.add("gain_schedule", GainSchedule(n=self._design.robot.n))
        return {"reference": "weighted_reference", "state": "weighted_state"}

    def _share(self, held: Index) -> Array:
        return self._design.inertia_share[held]
