"""Robots of tests as texts: those of files, and random chains."""

import atexit
import functools
import hashlib
import tempfile
from pathlib import Path

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import Robot, load_robot

_FILES = Path(__file__).with_name("robot_files")
ARM, URDF, RATE_TABLE, SIX, SEVEN = (
    (_FILES / name).read_text(encoding="utf-8")
    for name in ("arm.sdf", "arm.urdf", "rate_table.urdf", "six.urdf", "seven.urdf")
)
"""Robots without shapes, as their owners bring them.

ARM and URDF: a planar arm whose joints turn about y; at q = 0 it points along x. Link 1 is 0.8 m
long, with its centre of mass at 0.5 m; that of link 2 is 0.3 m from the elbow. RATE_TABLE: three
axes that meet in a point. SIX: parallel axes 2, 3, 4 and a wrist with offsets, of about a UR5e's
numbers. SEVEN: joint 4 does not reach 0, of about a Panda's numbers.
"""

_TURNS = (
    '<sdt:turns_with joint="shoulder">-30</sdt:turns_with><drake:gear_ratio>40</drake:gear_ratio>'
)
_TURNS += "<drake:rotor_inertia>4e-4</drake:rotor_inertia>"
WRIST = ARM.replace("<sdf ", '<sdf xmlns:sdt="urn:s" ').replace("g>0.7", "g>0")
WRIST = WRIST.replace("40</effort></limit></axis>", f"40</effort></limit></axis>{_TURNS}")
"""ARM without damping, whose second motor turns with both joints."""


def chain_names(n: int) -> tuple[str, ...]:
    """Joints of `chain_sdf`, base to tip: the alphabet would have them the other way round."""
    return tuple(f"joint_{chr(ord('z') - k)}" for k in range(n))


def chain_sdf(
    n: int,
    *,
    seed: int = 0,
    base: bool = False,
    rotor_inertia: float = 0.01,
    motors: dict[str, np.ndarray] | None = None,
    extra: str = "",
) -> str:
    """A random chain of n joints, declared in no order, with products of inertia and damping.

    Joint k = 1..n has effort 100 k, rotor inertia k `rotor_inertia`, gear ratio 2 and damping
    0.1 k, unless `motors` has them, each of shape (n,). With `base`, the first joint stands on a
    link that is welded to the world. `extra`: more elements of the model.
    """
    rng, k = np.random.default_rng(seed), np.arange(1, n + 1)
    given = {"effort": 100.0 * k, "rotor_inertia": k * rotor_inertia, "gear_ratio": 0.0 * k + 2}
    given |= {"damping": 0.1 * k} | (motors or {})
    parts = []
    for i, name in enumerate(chain_names(n)):
        parent = f"link_{i}" if i else "base" if base else "world"
        effort, rotor, ratio, damping = (float(x[i]) for x in given.values())
        # Four masses of 1.5 kg: an inertia that a body can have.
        r = rng.normal(scale=0.3, size=(4, 3))
        com = r.mean(axis=0)
        r -= com
        inertia = 1.5 * (np.sum(r**2) * np.eye(3) - r.T @ r)
        moments = "".join(
            f"<i{'xyz'[a]}{'xyz'[b]}>{float(inertia[a, b])!r}</i{'xyz'[a]}{'xyz'[b]}>"
            for a, b in zip(*np.triu_indices(3), strict=True)
        )
        parts.append(
            f'<link name="link_{i + 1}"><pose relative_to="{name}"/><inertial><mass>6</mass>'
            f"<pose>{_text(com)} 0 0 0</pose><inertia>{moments}</inertia></inertial></link>"
        )
        parts.append(
            f'<joint name="{name}" type="revolute"><pose relative_to='
            f'"{"__model__" if parent == "world" else parent}">'
            f"{_text(rng.uniform(-0.5, 0.5, size=6))}</pose>"
            f"<parent>{parent}</parent><child>link_{i + 1}</child>"
            f"<axis><xyz>{_text(rng.normal(size=3))}</xyz><limit><effort>{effort!r}</effort></limit>"
            f"<dynamics><damping>{damping!r}</damping></dynamics></axis>"
            f"<drake:rotor_inertia>{rotor!r}</drake:rotor_inertia>"
            f"<drake:gear_ratio>{ratio!r}</drake:gear_ratio></joint>"
        )
    if base:
        parts.append(
            '<link name="base"><inertial><mass>9</mass><inertia><ixx>1</ixx><iyy>1</iyy>'
            "<izz>1</izz></inertia></inertial></link>"
        )
        parts.append(
            '<joint name="anchor" type="fixed"><parent>world</parent><child>base</child></joint>'
        )
    rng.shuffle(parts)
    return (
        '<sdf version="1.9" xmlns:drake="http://drake.mit.edu" xmlns:sdt="urn:sdt_drake">'
        f'<model name="chain">{"".join(parts)}{extra}</model></sdf>'
    )


def _text(values) -> str:
    return " ".join(map(repr, map(float, values)))


def loaded(text: str, suffix: str = ".sdf", **held) -> Robot:
    """The robot of a text, in a file that stays until the tests end; `hold` and `tip` if any."""
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    path = _folder() / f"{name}{suffix}"
    path.write_text(text, encoding="utf-8")
    return load_robot(path, **held)


def refused(text: str, old: str, new: str, message: str) -> None:
    """A text with something else in it is refused in a short line, with file and place."""
    assert old in text
    suffix = ".urdf" if "<robot" in text else ".sdf"
    with pytest.raises(InputError, match=rf"^/.*\{suffix}: .*{message}") as error:
        loaded(text.replace(old, new), suffix)
    assert "\n" not in str(error.value) and len(str(error.value)) < 600


@functools.cache
def _folder() -> Path:
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return Path(folder.name)
