"""The recording of a run: its signals at the interpolation period."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, SkipValidation, WithJsonSchema

from sdt_drake.io.arguments import a_path, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.fields import field
from sdt_drake.io.shown import DataFrame, Figure, Shown, Summary, higher, joint_count, of_joints
from sdt_drake.io.tables import check_columns, check_limits, data_frame, read_table, write_table
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.probes import unit_of
from sdt_drake.run.scenario import Scenario

# Columns of a recording's file, in this order.
RECORDED_COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
    "tau_peak", "tau_rms", "tau_mean", "saturated", "beyond_stop",
)  # fmt: skip


_PROBES = "probes."

Column = Annotated[Array, SkipValidation, WithJsonSchema({"type": "number"})]
"""Numbers of a recording: the type that the reference of its columns shows."""
Columns = Annotated[Mapping[str, Array], SkipValidation, WithJsonSchema({"type": "number"})]
"""Several of them by name."""


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Shown):
    """Signals of a run at the interpolation period; shape (N + 1, n), time (N + 1,).

    Positions and speeds are those at `time`. Torques are those just before the update at `time`,
    the end of the period that ends there. The first row is just after its update.

    Torque within the periods is in `tau_peak`, `tau_rms`, `tau_mean` and `saturated`. If the
    proportional gain acts on the error, the held reference makes the torque fall within each
    period, by K_PS r times the change of speed. Then `tau_mean` is the torque that moves the links;
    `tau` is not.

    At the default accuracy, peaks are accurate to 3e-3 of the motor's torque limit, means to
    1.5e-3. The RMS of a period is accurate to 1.5e-3, or to 6e-3 if the torque changes its sign.
    In a period in which a motor starts or stops saturating, `saturated` is accurate to a third of
    an integrator step. Over a run these errors cancel.

    With `drive.encoder_resolution` a joint at the edge of an increment may be measured one
    increment away, at any accuracy. That moves the command of a sample by 2 pi K_PS / (drive period
    x resolution), motor side. Torques of single periods may be off by as much.
    """

    __pydantic_config__ = ConfigDict(use_attribute_docstrings=True, arbitrary_types_allowed=True)

    time: Column = field(unit="s")
    """Time since the start."""
    q_ref: Column = field(unit="rad", side="joint")
    """Position of the planned motion, also if the controller tracks a learned reference."""
    v_ref: Column = field(unit="rad/s", side="joint")
    """Speed of the planned motion, also if the controller tracks a learned reference."""
    q: Column = field(unit="rad", side="joint")
    """Position of the links."""
    v: Column = field(unit="rad/s", side="joint")
    """Speed of the links."""
    tau_cmd: Column = field(unit="N m", side="motor")
    """Torque that the controller commands."""
    tau_limited: Column = field(unit="N m", side="motor")
    """Commanded torque after saturation."""
    tau: Column = field(unit="N m", side="motor")
    """Torque of the motors; equal to `tau_limited` with an ideal drive."""
    load_torque: Column = field(unit="N m", side="motor")
    """Load torque tau_LD of Algorithm 1."""
    tau_peak: Column = field(unit="N m", side="motor")
    """Largest absolute torque of the motors in the period that ends at `time`."""
    tau_rms: Column = field(unit="N m", side="motor")
    """RMS torque of the motors in that period."""
    tau_mean: Column = field(unit="N m", side="motor")
    """Mean torque of the motors in that period; its time integral is their impulse."""
    saturated: Column = field(unit="-", side="motor")
    """Share of that period in which a limit of the motor cuts the command."""
    beyond_stop: Column = field(unit="rad", side="joint")
    """Angle by which a joint of the coupled plant exceeds its stops; 0 within them and on the axis
    plant. Stops push back with `plant.stops` alone."""
    q_measured: Column | None = field(None, unit="rad", side="joint")
    """Position that the encoders measure, on motors or links of elastic joints; not in files."""
    v_measured: Column | None = field(None, unit="rad/s", side="joint")
    """Speed that the encoders measure; not in files."""
    probes: Columns = field(dict, unit="as the output")
    """Outputs of blocks by the names of the probes, shape (N + 1, size). Rows are those just before
    the update at `time`, the first one just after it. None by default."""

    winding_temperature: Column | None = field(None, unit="°C", side="motor")
    """Temperature of the motors' windings; only with `plant.windings`."""

    @property
    def speed_error(self) -> Array:
        """Speed error v - v_ref, joint side [rad/s], shape (N + 1, n)."""
        return self.v - self.v_ref

    @property
    def position_error(self) -> Array:
        """Position error q - q_ref, joint side [rad], shape (N + 1, n)."""
        return self.q - self.q_ref

    def summary(self) -> Summary:
        columns = {
            "speed error [rad/s]": (".4f", np.abs(self.speed_error).max(axis=0)),
            "position error [deg]": (".3f", np.degrees(np.abs(self.position_error).max(axis=0))),
            "motor torque [N m]": (".1f", self.tau_peak.max(axis=0)),
            "saturated [%]": (".2f", 100 * self.saturated[1:].mean(axis=0)),
        }
        step, end = self.time[1] - self.time[0], self.time[-1]
        title = f"of {joint_count(self.q.shape[1])}: {end:.9g} s in steps of {1000 * step:.6g} ms"
        return of_joints(title, columns)

    def plot(self, design: Design | Scenario | None = None, joint: int | None = None) -> Figure:
        """Return a figure of speed, errors and torque; with a design, also names and limits.

        Args:
            design: the design or scenario of the run.
            joint: number of the only joint to show, 1..n; all by default.

        Raises:
            InputError: if there is no such joint, or the design has other joints.
        """
        design = None if design is None else as_design(design)
        title = "Recording" if design is None else design.scenario.summary().title
        return higher("show.figures.scope:scope")(title, self, design, joint)

    def to_pandas(self) -> DataFrame:
        """Return a data frame with the columns of `save`; its index is the time [s].

        Raises:
            InputError: if pandas is not installed.
        """
        return data_frame(self.time, self._columns)

    @property
    def _columns(self) -> dict[str, Array]:
        columns = {name: getattr(self, name) for name in RECORDED_COLUMNS}
        if self.winding_temperature is not None:
            columns["winding_temperature"] = self.winding_temperature
        return columns | {f"{_PROBES}{name}": values for name, values in self.probes.items()}

    @takes(path=a_path)
    def save(self, path: str | Path) -> None:
        """Write time and RECORDED_COLUMNS of each joint, without loss, as .csv, .mat or .parquet.

        Column k of a probe is "probes.NAME_k". The structure `units` in .mat files, and the
        metadata "unit" of columns in .parquet files, have the units of probes that state one.

        Raises:
            InputError: if the file cannot be written, or needs a package that is not installed.
        """
        units = {f"{_PROBES}{name}": unit_of(name) for name in self.probes}
        write_table(path, self.time, self._columns, units={k: v for k, v in units.items() if v})

    @staticmethod
    @takes(path=a_path)
    def load(path: str | Path) -> "Recording":
        """Read a file that `save` wrote, with its probes; further columns are ignored.

        Raises:
            InputError: naming file and line or column: missing columns, gaps in time, numbers that
                are not finite or exceed the limits of `check_limits`.
        """
        time, columns = read_table(path)
        check_limits(path, time, columns)
        names = [x.name for x in fields(Recording) if x.name in RECORDED_COLUMNS]
        listed = ", ".join(f"{name}_k" for name in names)
        again = "an older one has to be simulated again"
        expected = f"a recording as `simulate` writes it ({again}): time and for joint k {listed}"
        check_columns(path, columns, names, expected)
        names += ["winding_temperature"] * ("winding_temperature" in columns)
        probes = {x.removeprefix(_PROBES): columns[x] for x in columns if x.startswith(_PROBES)}
        return Recording(time=time, probes=probes, **{name: columns[name] for name in names})

    def to_csv(self, path: str | Path) -> None:
        """Write a file by the old name of `save`."""
        renamed("Recording.to_csv", "Recording.save")
        self.save(path)

    @staticmethod
    def from_csv(path: str | Path) -> "Recording":
        """Read a file by the old name of `load`."""
        renamed("Recording.from_csv", "Recording.load")
        return Recording.load(path)
