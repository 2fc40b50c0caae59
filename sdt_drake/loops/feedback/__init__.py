"""The feedbacks that controllers consist of, by the names that CONTROLLERS gives them.

One interface: `place(loop, reference, measured)` adds the blocks to a loop and returns the last
one, which has the output `tau_fb`, and with anti-windup the inputs `tau_cmd` and `tau`.
"""

from sdt_drake.loops.feedback import inverse_dynamics, position, scheduled, speed

FEEDBACKS = {
    "speed": speed.place,
    "position": position.place,
    "scheduled": scheduled.place,
    "inverse_dynamics": inverse_dynamics.place,
}
