"""Emergency stops by impulses in small steps, with the mass matrix of Pinocchio.

Independent: there are no events, no held joints and no integrator. In each step of Moreau and Jean
a joint gets an impulse that gives it the speed of its ramp, or none, within what its brake can do.
"""

import numpy as np

from oracles.pinocchio_model import pinocchio_robot

STEP = 1e-3  # s


def braked(robot, brakes, q, v, ramp, released, closed):
    """Stopping times [s] and largest angles [rad] of the joints; arguments as in `Schedule`."""
    pin, model = pinocchio_robot(robot)
    data = model.createData()
    q, v, start, speed = q.copy(), v.copy(), q.copy(), v.copy()
    own = robot.reflected_inertia + brakes.inertia
    stopped, angle, impulse, last = *np.zeros((3, robot.n)), v
    for k in range(round(30 / STEP)):
        time = k * STEP
        middle, fast = q + STEP * v / 2, 1.5 * v - 0.5 * last  # of the step
        M = pin.crba(model, data, middle)
        W = np.linalg.inv(np.triu(M) + np.triu(M, 1).T + np.diag(own))
        load = pin.nonLinearEffects(model, data, middle, fast) + robot.damping * fast
        driven, shut = time < released, time >= closed
        left = np.divide(time + STEP, ramp, out=np.ones(robot.n), where=ramp > 0)
        wanted = np.where(driven, speed * np.maximum(0.0, 1 - left), 0.0)
        torque = np.where(np.abs(v) > 1e-12, brakes.dynamic, brakes.static)
        most = np.where(driven, np.inf, np.where(shut, torque, 0.0)) * STEP
        free = v - STEP * W @ load
        before = np.inf
        while np.abs(impulse - before).max() > 1e-9 * np.abs(impulse).max():  # Gauss and Seidel
            before = impulse.copy()
            for i in range(robot.n):
                lacks = wanted[i] - free[i] - W[i] @ impulse
                impulse[i] = min(max(impulse[i] + lacks / W[i, i], -most[i]), most[i])
        last, v = v, free + W @ impulse
        v[np.abs(v - wanted) < 1e-7] = wanted[np.abs(v - wanted) < 1e-7]
        q = q + STEP * (last + v) / 2
        angle = np.maximum(angle, np.abs(q - start))
        stopped[(v != 0) | (last != 0)] = time + STEP
        if not v.any() and (driven | shut).all():
            return stopped, angle
    raise AssertionError("it moves on")
