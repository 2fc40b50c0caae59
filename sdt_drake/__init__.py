"""Motion control of spatial disorientation trainers, as Drake systems diagrams.

The way of the data, each step a module: `robot` (SDF), `motion` (profile, planner), `dynamics`
(torque groups, loads, effective inertia), `control` (tuning, step metrics), `scenario` and `design`
(a run as data, and resolved), `systems` and `loops` (Drake blocks and diagrams), `simulate`
(recordings), `analysis` (metrics, figures, claims, report).
"""

__version__ = "0.2.0"
