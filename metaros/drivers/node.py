"""`DriverNode`: the lifecycle node around one device. It opens it, with retries, and reports its status."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from metaros.clock import system_rng
from metaros.drivers.backoff import Backoff
from metaros.drivers.context import Device, DriverContext
from metaros.drivers.diagnostics import Diagnostics
from metaros.drivers.faults import FAULTS, FaultBox
from metaros.drivers.log_throttle import LogThrottle
from metaros.drivers.manifest import Manifest
from metaros.drivers.status import DriverState, DriverStatus
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
        make: Callable[[DriverContext], Device],
        parameters: Mapping[str, Any],
        *,
        context: Context,
        namespace: str = "/",
        name: str = "",
        backoff: Backoff | None = None,
    ) -> None:
        """Raises ConfigError: a parameter that it does not have, or cannot use."""
        self.manifest = manifest
        self._backoff = Backoff() if backoff is None else backoff
        self._make = make
        self._context: DriverContext | None = None
        self._device: Device | None = None
        self._thread: threading.Thread | None = None
        overrides = read_values(manifest, parameters)
        super().__init__(name or manifest.kind, namespace=namespace, context=context, parameter_overrides=overrides)
        try:
            declare(self, manifest)
            self.status = DriverStatus(self.clock, stale_after_s=manifest.stale_after_s)
            self.faults = FaultBox(system_rng())
            self._log_throttle = LogThrottle(self.clock)
            self._diagnostics = Diagnostics(self, manifest.kind, self.status)
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
                raise ConfigError(f"{self.full_name}: could not {transition}: {self.status.detail}")

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
        context = DriverContext(self, self.manifest, status=self.status, faults=self.faults)
        context.stop.set()  # until it is activated
        try:
            self._device = self._make(context)
        except ConfigError as error:
            context.close()
            self.status.enter(DriverState.FAILED, str(error))
            self.get_logger().error(str(error))
            return False
        self._context = context
        self.status.enter(DriverState.RESTING)
        return True

    def on_activate(self) -> bool:
        """Start working; refused while the device has not let go since the last time."""
        context, device = self._context, self._device
        assert context is not None
        assert device is not None
        if self._thread is not None and self._thread.is_alive():
            self.get_logger().error(f"{self.manifest.kind}: the device has still not let go")
            return False
        context.stop.clear()
        self._thread = threading.Thread(
            target=self._work, args=(context, device), name=f"driver {self.name}", daemon=True
        )
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

    def _work(self, context: DriverContext, device: Device) -> None:
        self._backoff.reset()
        while not context.stop.is_set():
            self.status.enter(DriverState.OPENING, self.status.detail)
            before = self.status.counters["readings"]
            why = ""
            try:
                if not context.stopping:
                    device.open()
                    device.run()
            except UnavailableError as error:
                why = str(error)
            except ClosedError:
                return
            except ConfigError as error:
                self.status.enter(DriverState.FAILED, str(error))
                self.get_logger().error(str(error))
                return
            except Exception as error:  # a fault of ours: said, and tried again, for a robot goes on
                why = f"driver error: {error!r}"
                if self._log_throttle.should_log(f"trace of {why}"):
                    LOG.exception("%s: the driver failed", self.full_name)
            finally:
                self._let_go(device)
            if self.status.counters["readings"] > before:
                self._backoff.reset()
            if not context.stop.is_set():
                self._await(context, self._backoff.next_s(), why or "the device ended")
        self.status.enter(DriverState.RESTING)

    def _await(self, context: DriverContext, wait_s: float, why: str) -> None:
        if self._log_throttle.should_log(why):
            self.get_logger().warn(f"{self.manifest.kind}: {why}; trying again")
        self.status.count("reconnects")
        self.status.enter(DriverState.WAITING, why)
        context.stop.wait(wait_s)

    def _let_go(self, device: Device) -> None:
        try:
            device.close()
        except Exception as error:  # whatever it says, it is opened anew
            if self._log_throttle.should_log(f"close: {error!r}"):
                LOG.exception("%s: the device could not be closed", self.full_name)

    def _halt(self) -> bool:
        if self._context is not None:
            self._context.stop.set()
        if self._thread is not None:
            self._thread.join(CLOSE_S)
            if self._thread.is_alive():
                self.get_logger().error(f"{self.manifest.kind}: the device did not let go within {CLOSE_S:g} s")
                return False
        self._thread = None
        return True

    def _forget(self) -> None:
        context, self._context, self._device = self._context, None, None
        if context is not None:
            context.close()

    # -- from others -----------------------------------------------------------------------------------------------

    def _changed(self, name: str, value: Any) -> None:
        context = self._context
        if context is not None and name in {parameter.name for parameter in self.manifest.parameters if parameter.live}:
            context.changed(name, value)

    def _on_fault(self, message: String) -> None:
        if self.faults.inject(message.data):
            self.get_logger().warn(f"simulated faults now: {', '.join(sorted(self.faults.on)) or 'none'}")
        else:
            self.get_logger().error(f"no fault {message.data!r}; there are {', '.join((*FAULTS, 'clear'))}")
