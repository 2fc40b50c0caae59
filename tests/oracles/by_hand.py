"""The loops in plain numpy, to compare with.

Independent: controllers, motors and axes are typed in from the equations of the paper and carried
through time by Runge and Kutta's method with fixed steps. Of the package come gains, the motion and
the tabulated load, which have oracles of their own; of Drake, the mass matrix. Neither blocks nor
the integrator with error control are used.
"""

import numpy as np

GEAR = np.array([67.2, 1, 1, 1])
LIMIT = np.array([203.2, 3950, 2150, 2150])  # N m, motor side
ROTORS = np.array([0.1291, 1.73, 0.531, 0.531])  # kg m², motor side, as published


def rk4(law, y, times, steps):
    """States at `times`, with `steps` steps of Runge and Kutta's fourth order in between.

    law(i) gives the derivative(t, y) while sample i is in force.
    """
    states = [y]
    for i, start in enumerate(times[:-1]):
        derivative = law(i)
        h = (times[i + 1] - start) / steps
        for t in start + h * np.arange(steps):
            k1 = derivative(t, y)
            k2 = derivative(t + h / 2, y + h / 2 * k1)
            k3 = derivative(t + h / 2, y + h / 2 * k2)
            k4 = derivative(t + h, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(y)
    return np.array(states)


def inverse_dynamics(design):
    """What the motors need along the motion, by the plant's mass matrix [N m], motor side."""
    plant, motion, tau = design.device.nominal.plant, design.reference.tracked, []
    context = plant.CreateDefaultContext()
    for q, v, vd in zip(motion.q, motion.v, motion.vd, strict=True):
        plant.SetPositionsAndVelocities(context, [*q, *v])
        M, bias = plant.CalcMassMatrix(context), plant.CalcBiasTerm(context)
        tau.append((M @ vd + bias - plant.CalcGravityGeneralizedForces(context)) / GEAR)
    return np.array(tau)


def _fed_forward(design):
    kind = design.scenario.controller.feedforward_in_use
    if kind == "none":
        return np.zeros_like(design.reference.tracked.v)
    return design.loads.load_torque if kind == "ctc" else inverse_dynamics(design)


class Motors:
    """PI controllers and saturation (Figures 3, 5 and 6), for several designs side by side, with
    the gains that follow the inertia, feedforward and torque errors; arrays (designs, n)."""

    def __init__(self, designs, *, widened=True):
        def side_by_side(get):
            return np.array([get(design) for design in designs])

        def choices(get):
            return np.array([[float(get(design.scenario))] for design in designs])

        self.motion = designs[0].reference.tracked
        self.kp_motor = side_by_side(lambda d: d.tuning.gains.kp * GEAR)
        self.ki = side_by_side(lambda d: d.tuning.gains.ki)
        self.inertia = side_by_side(lambda d: d.i_eff * GEAR)
        self.limit = side_by_side(lambda d: d.device.simulated.effort_limit / GEAR)
        self.load = side_by_side(lambda d: d.loads.load_torque)
        self.help = side_by_side(lambda d: widened * d.loads.alleviating_torque)
        self.tau_ff = side_by_side(_fed_forward)
        is_scheduled = choices(lambda s: s.controller.kind == "pi_scheduled")[..., None]
        self.share = np.where(is_scheduled, side_by_side(lambda d: d.tuning.inertia_share), 1.0)
        error = side_by_side(lambda d: np.array(d.drive.torque_error or np.zeros(4)))
        self.given = 1 + error
        self.p_on_error = choices(lambda s: s.controller.setpoint_weight)
        self.amplitude = choices(lambda s: s.disturbance.amplitude)
        self.omega_d = choices(lambda s: s.disturbance.omega_d)

    def sample(self, i):
        """While sample i is in force: tau(v, integral), what is integrated(v), and the load."""
        load, help_, share = self.load[:, i], self.help[:, i], self.share[:, i]
        lower = -self.limit + np.minimum(help_, 0)
        upper = self.limit + np.maximum(help_, 0)
        kp, v_ref = share * self.kp_motor, self.motion.v[i]
        fixed = self.p_on_error * kp * v_ref + self.tau_ff[:, i]

        def tau(v, integral):
            tau_cmd = fixed + self.ki * integral - kp * v
            return self.given * np.minimum(np.maximum(tau_cmd, lower), upper)

        return tau, lambda v: share * GEAR * (v_ref - v), load

    def surprise(self, t):
        """What share of the load the model does not know."""
        return self.amplitude * np.sin(self.omega_d * t)


def axes_by_hand(designs, *, steps=10):
    """Speeds of axes from rest, shape (N + 1, designs, n)."""
    motors = Motors(designs)

    def law(i):
        tau, rate, load = motors.sample(i)

        def derivative(t, y):
            v, integral = y
            against = load * (1 + motors.surprise(t))
            return np.array([(tau(v, integral) - against) / motors.inertia, rate(v)])

        return derivative

    return rk4(law, np.zeros((2, len(designs), 4)), motors.motion.time, steps)[:, 0]


def robot_by_hand(design, *, widened=False, steps=5):
    """States [q, v, integral] of the coupled plant from rest, shape (N + 1, 3, n)."""
    motors, plant = Motors([design], widened=widened), design.device.simulated.plant
    context = plant.CreateDefaultContext()

    def law(i):
        tau, rate, load = motors.sample(i)

        def derivative(t, y):
            q, v, integral = y
            plant.SetPositionsAndVelocities(context, [*q, *v])
            driven = GEAR * (tau(v, integral) - load * motors.surprise(t))[0]
            rest = plant.CalcGravityGeneralizedForces(context) - plant.CalcBiasTerm(context)
            vd = np.linalg.solve(plant.CalcMassMatrix(context), driven + rest)
            return np.array([v, vd, rate(v)[0]])

        return derivative

    start = [design.reference.tracked.q[0], np.zeros(4), np.zeros(4)]
    return rk4(law, np.array(start), design.reference.tracked.time, steps)
