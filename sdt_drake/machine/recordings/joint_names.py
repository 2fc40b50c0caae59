"""Columns that belong together, one for each joint, by names of joints or by numbers."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Family:
    """Columns with the same meaning, one for each joint."""

    columns: list[str]
    """Names of the columns, base to tip."""
    pattern: str
    """Common part of the names, with {joint} or {k} where they differ."""
    named_by: str = ""
    """Source of the joints' names: "the header", or names of columns; "" for numbers."""


def families(names: Sequence[str], texts: Mapping[str, str], joints: Sequence[str]) -> list[Family]:
    """Return the families of columns of a file; those that tell joints by names come first.

    Joints are found by their names in the header, by columns of names as ROS writes them
    (`name0`, `position0`), or else by numbers from 0 or 1.

    Args:
        names: Names of the columns.
        texts: Constant texts in columns, by the names of columns.
        joints: Names of the joints, base to tip.
    """
    n = len(joints)
    named: dict[str, dict[int, str]] = {}
    numbered: dict[str, dict[int, str]] = {}
    forms = _forms(joints)
    for name in names:
        k, pattern = _joint_in(name, forms)
        if k is not None:
            named.setdefault(pattern, {})[k] = name
        for match in re.finditer(r"\d+", name):
            pattern = f"{name[: match.start()]}{{k}}{name[match.end() :]}"
            numbered.setdefault(pattern, {})[int(match[0])] = name
    found = [
        Family([own[k] for k in range(n)], pattern, "the header")
        for pattern, own in named.items()
        if len(own) == n
    ]
    labels = [own for own in numbered.values() if all(name in texts for name in own.values())]
    for label in labels:
        of = {_joint_in(texts[name], forms)[0]: i for i, name in label.items()}
        source = f"{label[min(label)]}, ..."
        found += [
            Family([own[of[k]] for k in range(n)], pattern, source)
            for pattern, own in numbered.items()
            if own is not label and own.keys() == label.keys() and of.keys() >= {*range(n)}
        ]
    found += [
        Family([own[i] for i in sorted(own)], pattern)
        for pattern, own in numbered.items()
        if sorted(own) in ([*range(1, n + 1)], [*range(n)])
    ]
    return found


def other_order(columns: Sequence[str], found: Iterable[Family]) -> Family | None:
    """Return the family that tells another order of the joints for these columns, if one does."""
    same = (one for one in found if one.named_by and sorted(one.columns) == sorted(columns))
    family = next(same, None)
    return family if family is not None and family.columns != list(columns) else None


_Forms = list[tuple[tuple[str, ...], int]]


def _forms(joints: Sequence[str]) -> _Forms:
    """Return the forms in which names of joints are searched, longest first, with the joint.

    A form is a name in words: as a whole, without "joint", or without what all joints share.
    """
    whole = [_tokens(joint) for joint in joints]
    forms = dict[tuple[str, ...], set[int]]()
    for k, words in enumerate(whole):
        short = tuple(x for x in words if x != "joint")
        own = tuple(x for x in words if any(x not in other for other in whole))
        for form in {words, short, own}:
            if any(x.isalpha() for x in form):
                forms.setdefault(form, set()).add(k)
    sure = [(form, ks.pop()) for form, ks in forms.items() if len(ks) == 1]
    return sorted(sure, key=lambda one: -len(one[0]))


def _joint_in(text: str, forms: _Forms) -> tuple[int | None, str]:
    """Return the joint that a text names, from 0, or None, and the text without its name."""
    words = _tokens(text)
    for form, k in forms:
        for i in range(len(words) - len(form) + 1):
            if words[i : i + len(form)] == form:
                return k, " ".join([*words[:i], "{joint}", *words[i + len(form) :]])
    return None, ""


def _tokens(name: str) -> tuple[str, ...]:
    """Split a name into lower-case words and numbers: "ElbowJoint2" gives elbow, joint, 2."""
    return tuple(x.lower() for x in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^\W\d_A-Z]+|\d+", name))
