"""The pilot: motion of the head, thresholds, felt orientation, illusions, and reports of people.

`head`: specific force and angular velocity of a motion at the robot's frame `head`. `canals`: the
model of the semicircular canals. `thresholds`: which difference between two motions is felt.
`observer`: canals, otoliths and internal model as a block. `in_loop`: sensors at the head of a
loop, and the observer behind them. `orientation`: the orientation that the observer feels.
`illusions`: felt less true orientation. `reported`: the observer beside reports of
people. `pilots`: populations of pilots.

Ports of the observer have length 3, in axes of the head: inputs specific_force [m/s²] and
angular_rate [rad/s]; outputs, as felt, gravity [G], rate [rad/s] and acceleration [m/s²].
"""

from sdt_drake.pilot.in_loop import pilot_at_head
from sdt_drake.pilot.observer import internal_model, load_perception, orientation_observer

__all__ = ["internal_model", "load_perception", "orientation_observer", "pilot_at_head"]
