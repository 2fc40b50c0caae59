"""Robots, states and motions that hypothesis draws: random, but sensible.

Hypothesis draws the choices; the numbers come from a seed that it draws, in general position.
"""

import numpy as np
from hypothesis import strategies as st

from helpers.robots import chain_names, chain_sdf, loaded
from sdt_drake.motion import Motion, MotionProfile
from sdt_drake.motion.profile import Track
from sdt_drake.motion.segments import Hold, Ramp, Segment, Turn
from sdt_drake.motion.smooth import Fourier, Oscillation
from sdt_drake.robot.robot import Robot

GENERATORS = st.integers(0, 2**32 - 1).map(np.random.default_rng)
JOINTS = st.integers(1, 7)


def _spread(rng: np.random.Generator, low: float, high: float, n: int) -> np.ndarray:
    """Numbers of all sizes between two, evenly in their logarithm."""
    return np.exp(rng.uniform(np.log(low), np.log(high), n))


@st.composite
def robots(draw, joints=JOINTS, *, coupled: bool = False, head: bool = False) -> Robot:
    """Chains on skew axes, with products of inertia, gears from 0.5 to 200, and joint damping.

    Args:
        draw: of hypothesis.
        joints: how many.
        coupled: whether motors turn with other joints, too, as in wrists.
        head: whether a link has a pilot's head.
    """
    n, rng = draw(joints), draw(GENERATORS)
    gear_ratio = np.where(draw(st.booleans()), _spread(rng, 0.5, 200, n), 1.0)
    motors = {
        "effort": _spread(rng, 50, 5000, n),
        "rotor_inertia": draw(st.sampled_from([0.0, 1.0])) * _spread(rng, 1e-4, 0.1, n),
        "gear_ratio": gear_ratio,
        "damping": draw(st.sampled_from([0.0, 1.0])) * rng.uniform(0, 3, n),
    }
    link = rng.integers(1, n + 1) if head else n
    frame = f'<frame name="head" attached_to="link_{link}"><pose>0.1 -0.2 0.3 1 2 3</pose></frame>'
    seed, base = int(rng.integers(2**32)), draw(st.booleans())
    text = chain_sdf(n, seed=seed, base=base, motors=motors, extra=frame * head)
    names = chain_names(n)
    for k in range(1, n if coupled else 0):
        turns, before = float(rng.uniform(-0.5, 0.5) * gear_ratio[k]), names[k - 1]
        element = f'<sdt:turns_with joint="{before}">{turns!r}</sdt:turns_with></joint>'
        start = text.index(f'<joint name="{names[k]}"')
        text = text[:start] + text[start:].replace("</joint>", element, 1)
    return loaded(text)


@st.composite
def moving(draw, count: int = 3, **options) -> tuple[Robot, *tuple[np.ndarray, ...]]:
    """A robot, and q, v, vd [rad, rad/s, rad/s²], each of shape (count, n)."""
    robot, rng = draw(robots(**options)), draw(GENERATORS)
    size = np.array([3.0, 2.0, 5.0])[:, None, None]
    return robot, *size * rng.uniform(-1, 1, (3, count, robot.n))


@st.composite
def motions(draw, n: int, *, period: float = 0.005, samples: int = 100) -> Motion:
    """Motions from rest to rest: three harmonics of each joint, up to about 1 rad/s."""
    rng = draw(GENERATORS)
    phase = 2 * np.pi * np.linspace(0, 1, samples)
    harmonics = np.sin(np.multiply.outer(phase, np.arange(1, 4)))
    v = harmonics @ rng.uniform(-0.3, 0.3, (3, n))
    v[[0, -1]] = 0
    return Motion.from_speeds(period, rng.uniform(-2, 2, n), v)


@st.composite
def profiles(draw, robot: Robot, *, duration: float = 3.0) -> MotionProfile:
    """Motion profiles from rest to rest, with all kinds of segments, up to about 1 rad/s."""
    rng = draw(GENERATORS)

    def segments() -> list[Segment]:
        blend = str(rng.choice(["cosine", "linear"]))
        a, b, c = rng.uniform(-1, 1, 3)
        kinds = [
            [Turn(by_deg=15 * a, duration=1, blend=blend)],
            [Turn(to_deg=20 * a, duration=1.0, blend=blend)],
            [Ramp(to_deg_s=40 * a, duration=0.5, blend=blend), Hold(duration=0.3),
             Ramp(to_deg_s=0, acceleration_deg_s2=180 + 60 * b, blend=blend)],
            [Oscillation(amplitude=0.05 * a, period=0.8 + 0.3 * b, fade=0.3, end=1)],
            [Fourier(period=1, sine=[0.04 * a, -0.02 * a], cosine=[0.04 * b, 0.02 * c], end=1)],
        ]  # fmt: skip
        return kinds[rng.integers(len(kinds))]

    names = draw(st.lists(st.sampled_from(robot.joint_names), min_size=1, unique=True))
    tracks = [
        Track(joint=name, segments=[Hold(duration=rng.uniform(0.1, 0.4)), *segments(), *segments()])
        for name in names
    ]
    start = rng.uniform(-20, 20, robot.n).tolist()
    return MotionProfile(name="any", duration=duration, start_deg=start, tracks=tracks)
