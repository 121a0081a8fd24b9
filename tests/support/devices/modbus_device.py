"""A Modbus device for tests: pymodbus's own server, over TCP or a pty, on a thread of its own."""

from __future__ import annotations

import asyncio
import os
import select
import threading
import tty
from types import TracebackType
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from tests.support.devices.pty_device import PtyDevice

__all__ = ["ModbusDevice", "PtyBridge"]


class ModbusDevice:
    """Holding and input registers 0 to 99, coils and discrete inputs 0 to 99. `port` a number: TCP; a path: serial."""

    def __init__(self, port: int | str, *, unit: int = 1, holding: list[int] | None = None, **serial: Any) -> None:
        self.requests: list[tuple[int, int, int]] = []  # function, address, count
        self.written: list[tuple[int, int, list[Any]]] = []  # function, address, values
        self.refused: set[int] = set()  # addresses that it says are illegal
        self.delay_s = 0.0
        self._port, self._serial = port, serial
        words = (holding or []) + [0] * (100 - len(holding or []))
        registers = [SimData(0, values=words, datatype=DataType.REGISTERS)]
        bits = [SimData(0, values=[number % 2 == 1 for number in range(112)], datatype=DataType.BITS)]
        self._device = SimDevice(id=unit, simdata=(bits, bits, registers, registers), action=self._on_request)
        self._ready = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: Any = None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="modbus device")
        self._thread.start()
        assert self._ready.wait(60)

    def close(self) -> None:
        """It is switched off."""
        assert self._loop is not None
        asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(60)
        self._thread.join(60)
        assert not self._thread.is_alive()

    def __enter__(self) -> ModbusDevice:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        if isinstance(self._port, int):
            self._server = ModbusTcpServer(self._device, address=("127.0.0.1", self._port))
        else:
            self._server = ModbusSerialServer(self._device, port=self._port, baudrate=9600, **self._serial)
        await self._server.serve_forever(background=True)
        self._ready.set()
        await self._server.serving

    async def _on_request(
        self, function: int, _start: int, address: int, count: int, _now: list[int], values: list[Any] | None
    ) -> ExcCodes | None:
        self.requests.append((function, address, count))
        if self.delay_s:
            await asyncio.sleep(self.delay_s)
        if self.refused & set(range(address, address + count)):
            return ExcCodes.ILLEGAL_ADDRESS
        if values is not None:
            self.written.append((function, address, list(values)))
        return None


class PtyBridge:
    """Joins a PtyDevice, which the driver opens, to a second pty, whose `path` pymodbus's serial server opens."""

    def __init__(self, pty: PtyDevice) -> None:
        self._pty = pty
        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._pump, name="pty bridge")
        self._thread.start()

    def close(self) -> None:
        """Take it away."""
        self._stop.set()
        self._thread.join(60)
        assert not self._thread.is_alive()
        os.close(self._master)
        os.close(self._slave)

    def __enter__(self) -> PtyBridge:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _pump(self) -> None:
        while not self._stop.wait(0.002):
            if data := self._pty.read(0.002):
                os.write(self._master, data)
            if select.select([self._master], [], [], 0)[0]:
                self._pty.write(os.read(self._master, 4096))
