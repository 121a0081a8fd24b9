"""The driver: reads the points when they are due, publishes them, and writes what the map allows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from pymodbus.pdu import ModbusPDU

from metaros.drivers.modbus.client import Client, NoAnswerError, open_client
from metaros.drivers.modbus.link import read_link
from metaros.drivers.modbus.orders import Order, Orders
from metaros.drivers.modbus.plan import Group, Plan
from metaros.drivers.modbus.points import Point, read_map
from metaros.drivers.modbus.protocol import EXCEPTIONS, RefusedError, Request, write_request
from metaros.drivers.unit import DriverPublisher, Unit
from metaros.errors import UnavailableError
from metaros.interfaces.std_msgs.msg import Bool, Float64
from metaros.wire import qos_command, qos_default

__all__ = ["ModbusDevice", "make"]

MOST_SILENCES: Final = 3  # in a row, then it is away
_LOOK_S: Final = 0.05
_ILLEGAL_ADDRESS: Final = 2


def make(unit: Unit) -> ModbusDevice:
    """A device on the link of the parameters."""
    return ModbusDevice(unit)


class ModbusDevice:
    """What was ordered while the device is away is refused; when it is back, nothing is written by itself."""

    def __init__(self, unit: Unit) -> None:
        self._unit = unit
        self._link = read_link(unit["link"])
        self._points = read_map(unit["map"])
        self._plan = Plan(self._points)
        self._orders = Orders(self._points)
        self._client: Client | None = None
        self._silences = 0
        self._working = False
        self._problems: dict[str, str] = {}
        self._publishers: dict[str, DriverPublisher] = {}
        for point in self._points:
            message_type = Bool if point.is_bit else Float64
            self._publishers[point.name] = unit.publisher(message_type, f"modbus/{point.name}", qos_default)
            if point.writable:
                unit.subscription(message_type, f"modbus/{point.name}/set", self._taker(point), qos_command)

    def open(self) -> None:
        """Reach the device: it must answer one request, if only by a refusal."""
        unit = self._unit
        self._silences = 0
        self._problems.clear()
        self._plan = Plan(self._points)
        self._client = open_client(unit, self._link, device=unit["unit_id"], timeout_s=unit["timeout"])
        try:
            self._client.ask(self._plan.groups[0].request)
        except RefusedError:
            pass
        except NoAnswerError:
            raise UnavailableError(f"{self._link.name}: unit {unit['unit_id']} does not answer") from None
        self._rest()  # what was ordered before the device was away
        self._working = True
        unit.opened(f"unit {unit['unit_id']} on {self._link.name}")

    def run(self) -> None:
        """Write what was ordered, read what is due."""
        unit = self._unit
        while not unit.stopping:
            now_s = unit.clock.monotonic_s()
            self._write(self._orders.take(now_s))
            for group in self._plan.due(now_s):
                self._read(group)
                self._write(self._orders.take(unit.clock.monotonic_s()))
                if unit.stop.is_set():
                    return
            unit.wait(min(_LOOK_S, self._plan.wait_s(unit.clock.monotonic_s())))

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
        for point, registers in self._orders.end():
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
        self._unit.count("unsafe_ends")
        self._orders.unwritten(point)

    # -- from others -----------------------------------------------------------------------------------------------

    def _taker(self, point: Point) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            now_s = self._unit.clock.monotonic_s()
            if not self._working or not self._orders.give(point.name, message.data, now_s):
                self._unit.count("refused_commands")

        return take

    # -- the device ------------------------------------------------------------------------------------------------

    def _read(self, group: Group) -> None:
        names = ", ".join(point.name for point in group.points)
        request = group.request
        answer = self._ask(names, request)
        if answer is None:
            if len(group.points) > 1 and self._problems.get(names) == EXCEPTIONS[_ILLEGAL_ADDRESS]:
                del self._problems[names]
                self._tell()
                self._plan.split(group)
                self._unit.count("split_requests")
            return
        values = request.values(answer)
        for point in group.points:
            value = point.value(group.raw(point, values))
            message = Bool(data=bool(value)) if point.is_bit else Float64(data=float(value))
            self._publishers[point.name].publish(message)

    def _write(self, orders: list[Order]) -> None:
        for point, registers in orders:
            if self._ask(f"{point.name}/set", write_request(point.table, point.address, registers)) is not None:
                self._orders.written(point, registers)
                self._unit.count("writes")

    def _ask(self, what: str, request: Request) -> ModbusPDU | None:
        client = self._client
        assert client is not None
        try:
            answer = client.ask(request)
        except RefusedError as error:
            self._silences = 0
            self._unit.count("refusals")
            self._problems[what] = str(error)
            self._tell()
            return None
        except NoAnswerError:
            self._silences += 1
            self._unit.count("timeouts")
            if self._silences >= MOST_SILENCES:
                raise UnavailableError(f"{self._link.name}: no answer {MOST_SILENCES} times") from None
            return None
        self._silences = 0
        if self._problems.pop(what, None) is not None:
            self._tell()
        return answer

    def _tell(self) -> None:
        problems = [f"{what}: {why}" for what, why in self._problems.items()]
        more = f" and {len(problems) - 3} more" if len(problems) > 3 else ""
        self._unit.warn("; ".join(problems[:3]) + more)
