"""The driver: reads the points when they are due, publishes them, and writes what the map allows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from pymodbus.pdu import ModbusPDU

from metaros.drivers.context import DriverContext, DriverPublisher
from metaros.drivers.modbus.client import Client, NoAnswerError, open_client
from metaros.drivers.modbus.link import read_link
from metaros.drivers.modbus.pending_writes import PendingWrites, Write
from metaros.drivers.modbus.points import Point, read_map
from metaros.drivers.modbus.polling_plan import Group, PollingPlan
from metaros.drivers.modbus.protocol import EXCEPTIONS, RefusedError, Request, write_request
from metaros.errors import UnavailableError
from metaros.interfaces.std_msgs.msg import Bool, Float64
from metaros.wire import qos_command, qos_default

__all__ = ["ModbusDevice", "make"]

MOST_SILENCES: Final = 3  # in a row, then it is away
_LOOK_S: Final = 0.05
_ILLEGAL_ADDRESS: Final = 2


def make(context: DriverContext) -> ModbusDevice:
    """A device on the link of the parameters."""
    return ModbusDevice(context)


class ModbusDevice:
    """Commands are refused while the device is disconnected; when it is back, nothing is written by itself."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._link = read_link(context["link"])
        self._points = read_map(context["map"])
        self._plan = PollingPlan(self._points)
        self._writes = PendingWrites(self._points)
        self._client: Client | None = None
        self._silences = 0
        self._working = False
        self._problems: dict[str, str] = {}
        self._publishers: dict[str, DriverPublisher] = {}
        for point in self._points:
            message_type = Bool if point.is_bit else Float64
            self._publishers[point.name] = context.publisher(message_type, f"modbus/{point.name}", qos_default)
            if point.writable:
                context.subscription(message_type, f"modbus/{point.name}/set", self._taker(point), qos_command)

    def open(self) -> None:
        """Reach the device: it must answer one request, if only by a refusal."""
        context = self._context
        self._silences = 0
        self._problems.clear()
        self._plan = PollingPlan(self._points)
        self._client = open_client(context, self._link, device=context["unit_id"], timeout_s=context["timeout"])
        try:
            self._client.ask(self._plan.groups[0].request)
        except RefusedError:
            pass
        except NoAnswerError:
            raise UnavailableError(f"{self._link.name}: unit {context['unit_id']} does not answer") from None
        self._rest()  # what was ordered before the device was away
        self._working = True
        context.opened(f"unit {context['unit_id']} on {self._link.name}")

    def run(self) -> None:
        """Write what was ordered, read what is due."""
        context = self._context
        while not context.stopping:
            now_s = context.clock.monotonic_s()
            self._write(self._writes.take(now_s))
            for group in self._plan.due(now_s):
                self._read(group)
                self._write(self._writes.take(context.clock.monotonic_s()))
                if context.stop.is_set():
                    return
            context.wait(min(_LOOK_S, self._plan.wait_s(context.clock.monotonic_s())))

    def close(self) -> None:
        """Write the safe values of what was ordered, if it is there; let the line go."""
        working, self._working = self._working, False
        if working:
            self._rest()
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def _rest(self) -> None:
        """Write the safe value of each point that was moved; what the device does not take now, it is given later."""
        client = self._client
        for point, registers in self._writes.end():
            try:
                if client is None:
                    raise UnavailableError("no line")
                client.ask(write_request(point.table, point.address, registers))
            except UnavailableError:
                client = None
                self._unsafe(point)
            except (NoAnswerError, RefusedError):
                self._unsafe(point)

    def _unsafe(self, point: Point) -> None:
        self._context.count("unsafe_ends")
        self._writes.unwritten(point)

    # -- from others -----------------------------------------------------------------------------------------------

    def _taker(self, point: Point) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            now_s = self._context.clock.monotonic_s()
            if not self._working or not self._writes.give(point.name, message.data, now_s):
                self._context.count("refused_commands")

        return take

    # -- the device ------------------------------------------------------------------------------------------------

    def _read(self, group: Group) -> None:
        names = ", ".join(point.name for point in group.points)
        request = group.request
        answer = self._ask(names, request)
        if answer is None:
            if len(group.points) > 1 and self._problems.get(names) == EXCEPTIONS[_ILLEGAL_ADDRESS]:
                del self._problems[names]
                self._update_warning()
                self._plan.split(group)
                self._context.count("split_requests")
            return
        values = request.values(answer)
        for point in group.points:
            value = point.value(group.raw(point, values))
            message = Bool(data=bool(value)) if point.is_bit else Float64(data=float(value))
            self._publishers[point.name].publish(message)

    def _write(self, orders: list[Write]) -> None:
        for point, registers in orders:
            if self._ask(f"{point.name}/set", write_request(point.table, point.address, registers)) is not None:
                self._writes.written(point, registers)
                self._context.count("writes")

    def _ask(self, what: str, request: Request) -> ModbusPDU | None:
        client = self._client
        assert client is not None
        try:
            answer = client.ask(request)
        except RefusedError as error:
            self._silences = 0
            self._context.count("refusals")
            self._problems[what] = str(error)
            self._update_warning()
            return None
        except NoAnswerError:
            self._silences += 1
            self._context.count("timeouts")
            if self._silences >= MOST_SILENCES:
                raise UnavailableError(f"{self._link.name}: no answer {MOST_SILENCES} times") from None
            return None
        self._silences = 0
        if self._problems.pop(what, None) is not None:
            self._update_warning()
        return answer

    def _update_warning(self) -> None:
        problems = [f"{what}: {why}" for what, why in self._problems.items()]
        more = f" and {len(problems) - 3} more" if len(problems) > 3 else ""
        self._context.warn("; ".join(problems[:3]) + more)
