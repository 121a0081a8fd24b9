"""`DriverNode`: the lifecycle node around one device. It opens it, again and again, and tells how it stands."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from metaros.clock import system_rng
from metaros.drivers.back_off import BackOff
from metaros.drivers.diagnostics import Diagnostics
from metaros.drivers.faults import FAULTS, FaultBox
from metaros.drivers.manifest import Manifest
from metaros.drivers.repeats import Repeats
from metaros.drivers.standing import DriverState, Standing
from metaros.drivers.unit import Device, Unit
from metaros.drivers.values import declare, read_values
from metaros.errors import ClosedError, ConfigError, UnavailableError
from metaros.interfaces.std_msgs.msg import String
from metaros.node import Context
from metaros.node.lifecycle import LifecycleNode

__all__ = ["DriverNode"]

CLOSE_S: Final = 3.0
LOG = logging.getLogger("metaros.drivers")


class DriverNode(LifecycleNode):
    """Configure reads the parameters and makes the topics, activate starts the thread that works with the device."""

    def __init__(
        self,
        manifest: Manifest,
        make: Callable[[Unit], Device],
        parameters: Mapping[str, Any],
        *,
        context: Context,
        namespace: str = "/",
        name: str = "",
        back_off: BackOff | None = None,
    ) -> None:
        """Raises ConfigError: a parameter that it does not have, or cannot use."""
        self.manifest = manifest
        self._back_off = BackOff() if back_off is None else back_off
        self._make = make
        self._unit: Unit | None = None
        self._device: Device | None = None
        self._thread: threading.Thread | None = None
        overrides = read_values(manifest, parameters)
        super().__init__(name or manifest.kind, namespace=namespace, context=context, parameter_overrides=overrides)
        try:
            declare(self, manifest)
            self.standing = Standing(self.clock, stale_after_s=manifest.stale_after_s)
            self.faults = FaultBox(system_rng())
            self._repeats = Repeats(self.clock)
            self._diagnostics = Diagnostics(self, manifest.kind, self.standing)
            self.parameters.on_change()(self._changed)
            if self.parameters["allow_faults"]:
                self.create_subscription(String, "~/fault", self._on_fault, 10)
        except BaseException:
            self.close()
            raise

    def start(self) -> None:
        """Configure and activate. Raises ConfigError where that fails."""
        for transition in ("configure", "activate"):
            if not self.trigger(transition):
                raise ConfigError(f"{self.full_name}: could not {transition}: {self.standing.detail}")

    def stop(self) -> None:
        """Let the device go, then leave the graph."""
        self._halt()
        self._forget()
        self.close()

    @property
    def ended(self) -> bool:
        """Whether its thread ended by itself: the context was closed, or its configuration cannot work."""
        return self._thread is not None and not self._thread.is_alive()

    # -- lifecycle -------------------------------------------------------------------------------------------------

    def on_configure(self) -> bool:
        """Make the device's topics; a value that cannot work is logged and refused."""
        unit = Unit(self, self.manifest, standing=self.standing, faults=self.faults)
        unit.stop.set()  # until it is activated
        try:
            self._device = self._make(unit)
        except ConfigError as error:
            unit.close()
            self.standing.enter(DriverState.FAILED, str(error))
            self.get_logger().error(str(error))
            return False
        self._unit = unit
        self.standing.enter(DriverState.RESTING)
        return True

    def on_activate(self) -> bool:
        """Start working; refused while the device has not let go since the last time."""
        unit, device = self._unit, self._device
        assert unit is not None
        assert device is not None
        if self._thread is not None and self._thread.is_alive():
            self.get_logger().error(f"{self.manifest.kind}: the device has still not let go")
            return False
        unit.stop.clear()
        self._thread = threading.Thread(target=self._work, args=(unit, device), name=f"driver {self.name}", daemon=True)
        self._thread.start()
        return True

    def on_deactivate(self) -> bool:
        """Let the device go, keep the topics."""
        return self._halt()

    def on_cleanup(self) -> bool:
        """Take back the topics."""
        self._forget()
        return True

    def on_shutdown(self) -> bool:
        """Both."""
        halted = self._halt()
        self._forget()
        return halted

    # -- the device's thread ---------------------------------------------------------------------------------------

    def _work(self, unit: Unit, device: Device) -> None:
        self._back_off.worked()
        while not unit.stop.is_set():
            self.standing.enter(DriverState.OPENING, self.standing.detail)
            before = self.standing.counters["readings"]
            why = ""
            try:
                if not unit.stopping:
                    device.open()
                    device.run()
            except UnavailableError as error:
                why = str(error)
            except ClosedError:
                return
            except ConfigError as error:
                self.standing.enter(DriverState.FAILED, str(error))
                self.get_logger().error(str(error))
                return
            except Exception as error:  # a fault of ours: said, and tried again, for a robot goes on
                why = f"driver error: {error!r}"
                if self._repeats.fresh(f"trace of {why}"):
                    LOG.exception("%s: the driver failed", self.full_name)
            finally:
                self._let_go(device)
            if self.standing.counters["readings"] > before:
                self._back_off.worked()
            if not unit.stop.is_set():
                self._await(unit, self._back_off.next_s(), why or "the device ended")
        self.standing.enter(DriverState.RESTING)

    def _await(self, unit: Unit, wait_s: float, why: str) -> None:
        if self._repeats.fresh(why):
            self.get_logger().warn(f"{self.manifest.kind}: {why}; trying again")
        self.standing.count("reconnects")
        self.standing.enter(DriverState.WAITING, why)
        unit.stop.wait(wait_s)

    def _let_go(self, device: Device) -> None:
        try:
            device.close()
        except Exception as error:  # whatever it says, it is opened anew
            if self._repeats.fresh(f"close: {error!r}"):
                LOG.exception("%s: the device could not be closed", self.full_name)

    def _halt(self) -> bool:
        if self._unit is not None:
            self._unit.stop.set()
        if self._thread is not None:
            self._thread.join(CLOSE_S)
            if self._thread.is_alive():
                self.get_logger().error(f"{self.manifest.kind}: the device did not let go within {CLOSE_S:g} s")
                return False
        self._thread = None
        return True

    def _forget(self) -> None:
        unit, self._unit, self._device = self._unit, None, None
        if unit is not None:
            unit.close()

    # -- from others -----------------------------------------------------------------------------------------------

    def _changed(self, name: str, value: Any) -> None:
        unit = self._unit
        if unit is not None and name in {parameter.name for parameter in self.manifest.parameters if parameter.live}:
            unit.changed(name, value)

    def _on_fault(self, message: String) -> None:
        if self.faults.inject(message.data):
            self.get_logger().warn(f"simulated faults now: {', '.join(sorted(self.faults.on)) or 'none'}")
        else:
            self.get_logger().error(f"no fault {message.data!r}; there are {', '.join((*FAULTS, 'clear'))}")
