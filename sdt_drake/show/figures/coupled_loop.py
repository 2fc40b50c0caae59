"""The figure of a coupled loop: Nyquist curves, poles and zeros, and singular values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.frequency_response import FrequencyResponse
from sdt_drake.show.style import finish, grid, joint_title, nth_look, plain_numbers, style

_NEAR = ((-3.0, 1.5), (-2.2, 2.2))  # shown part of the Nyquist plane


def coupled_loop(title: str, response: FrequencyResponse, joint_names: Sequence[str]) -> Figure:
    """Draw Nyquist curves of each joint's loop, poles and zeros, and singular values.

    The Nyquist curves are those of the loop gains, each with all other loops closed: a stable loop
    does not go around -1. Poles and zeros are those of the coupled loop, and so are the singular
    values, from all speed references to all speeds.
    """
    with style():
        figure, axes = grid(1, 3, panel=(3.0, 2.9), gaps=(0.85, 0.35), sharex=False)
        nyquist, plane, singular = axes[0]
        circle = np.exp(2j * np.pi * np.linspace(0, 1, 200))
        nyquist.plot(circle.real, circle.imag, color="0.8", linewidth=0.8)
        nyquist.plot(-1, 0, "k+")
        for k, name in enumerate(joint_names):
            look, gain = nth_look(k), response.loop_gain[:, k]
            own = {"color": look.colour, "linestyle": look.dashes, "label": joint_title(k, name)}
            nyquist.plot(gain.real, gain.imag, **own)
        nyquist.set(xlim=_NEAR[0], ylim=_NEAR[1], xlabel="real part", ylabel="imaginary part")
        nyquist.set_title(f"Nyquist, cut at {response.cut}", loc="left", fontweight="bold")
        for values, marker, label in ((response.poles, "x", "pole"), (response.zeros, "o", "zero")):
            plane.plot(values.real, values.imag, marker, color="0.2", fillstyle="none", label=label)
        plane.axvline(0, color="0.4", linewidth=0.8)
        plane.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]")
        plane.set_title("poles and zeros", loc="left", fontweight="bold")
        decibel = 20 * np.log10(np.maximum(response.singular_values, 1e-6))
        singular.semilogx(response.omega, decibel, color="0.2", linewidth=0.9)
        singular.set(ylim=(-60, None), xlabel="frequency [rad/s]", ylabel="singular value [dB]")
        singular.set_title("speeds over their references", loc="left", fontweight="bold")
        singular.margins(x=0)
        plain_numbers(singular.xaxis)
        return finish(figure, title)
