"""The motion of a pilot's head in flight from a flight simulator, by UDP."""

from __future__ import annotations

import math
import socket
from pathlib import Path
from typing import Any
from weakref import finalize, proxy

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from sdt_drake.io.arguments import positive, takes, whole_number
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.flight import FlightColumns, load_flight_columns
from sdt_drake.pilot.head import GRAVITY

_LARGEST = 65536  # bytes of a datagram
_MOST = 1000  # datagrams in a period; more wait for the next one


class UdpFlight(LeafSystem):
    """Motion of a pilot's head, received as text by UDP on this machine.

    A datagram is a line of seven numbers with commas: time, specific force and angular rate, each
    along x, y, z, such as JSBSim's output of type SOCKET sends. The newest one counts. Lines of
    labels, which begin with "<", are skipped. `refused` counts others that are not seven finite
    numbers. Until the first datagram the flight is level; after a silence it is not finite.
    State: the flight, the time of the last datagram, and the count.

    .. pydrake_system::

        name: UdpFlight
        output_ports: [flight, refused]
    """

    __slots__ = ()  # pydrake never frees a system with a second __dict__

    @takes(port=whole_number, silence=positive, period=positive)
    def __init__(
        self,
        port: int = 0,
        *,
        columns: FlightColumns | str | Path | None = None,
        silence: float = 0.5,
        period: float = 0.005,
    ) -> None:
        """Open the port.

        Args:
            port: Port of this machine, 0 for any free one; the property `port` tells which.
            columns: Units, signs and axes, a mapping file, or the name of a shipped one; names and
                levers of it do not count. By default m/s² and rad/s, x forward, y left, z up.
            silence: Time without a datagram after which the flight is not finite [s].
            period: Sample period [s].

        Raises:
            InputError: The port cannot be opened, or the mapping cannot be read.
        """
        super().__init__()
        block: Any = proxy(self)  # Drake keeps functions forever that refer to their own system
        named = (
            columns if isinstance(columns, FlightColumns | None) else load_flight_columns(columns)
        )
        self._columns = named or FlightColumns()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        finalize(self, self._socket.close)
        try:
            self._socket.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise InputError(f"{port} cannot be opened: {error}", place="port") from None
        level = np.array([0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0])
        flight = self.DeclareDiscreteState(level)
        nothing = np.array([math.inf, 0.0])  # time of the last datagram [s], number of refused ones
        heard = self.DeclareDiscreteState(nothing)

        def receive(context: Context, values: DiscreteValues) -> None:
            last, refused = context.get_discrete_state(int(heard)).value()
            newest, bad = block._received()
            if newest is not None:
                last = context.get_time()
                values.set_value(int(flight), newest)
            elif context.get_time() - last > silence:
                values.set_value(int(flight), np.full(6, np.nan))
            values.set_value(int(heard), np.array([last, refused + bad]))

        def tell(context: Context, output: BasicVector) -> None:
            output.SetAtIndex(0, context.get_discrete_state(int(heard)).value()[1])

        self.DeclareStateOutputPort("flight", flight)
        self.DeclareVectorOutputPort("refused", 1, tell, {self.discrete_state_ticket(heard)})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, receive)

    @property
    def port(self) -> int:
        """The open port."""
        return int(self._socket.getsockname()[1])

    def _received(self) -> tuple[Array | None, int]:
        """Return the newest motion since the last call, None for none, and the refused lines."""
        newest, refused = None, 0
        for _ in range(_MOST):
            try:
                text = self._socket.recv(_LARGEST).decode("ascii", "replace").strip()
            except BlockingIOError:
                break
            if text.startswith("<"):
                continue
            try:
                _, *numbers = map(float, text.split(","))
                values = np.array(numbers).reshape(2, 1, 3)
            except ValueError:
                refused += 1
                continue
            if np.isfinite(values).all():
                force, rate = self._columns.force_of(values[0]), self._columns.rate_of(values[1])
                newest = np.concatenate([force[0], rate[0]])
            else:
                refused += 1
        return newest, refused
