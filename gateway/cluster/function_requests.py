"""Function calls of gateways that run no functions: a peer that does runs them and returns the result."""

from __future__ import annotations

import json
from typing import Any, Final, Protocol

from gateway.automation.functions import errors as function_errors
from gateway.automation.functions.errors import FunctionsOffError
from gateway.automation.functions.invoker import Call, Invoked, RemoteInvoke
from gateway.cluster.errors import PeerBusyError, PeerGoneError, PeerRefusedError, PeerTimeoutError
from gateway.cluster.ports import Mesh
from gateway.cluster.relay.wire import join, split
from metaros.automation.functions.calls import Outcome
from metaros.automation.functions.errors import EngineClosedError, ThrottledError
from metaros.errors import MetarosError, TooLargeError
from metaros.limits import LIMITS

__all__ = ["FunctionRequests", "Invoker"]

INVOKE, OFFER = "invoke", "errands.offer"
FUNCTION_S = 900.0  # the longest that a function may run
AT_ONCE = LIMITS.cluster_asks // 2  # calls of ours that peers have
MARGIN_S = 30.0  # to start a worker, and for both ways
KINDS: Final[dict[str, type[MetarosError]]] = {
    kind.code: kind
    for kind in (
        EngineClosedError,
        TooLargeError,
        *(getattr(function_errors, name) for name in function_errors.__all__),
    )
}


class Invoker(Protocol):
    """Calls functions here."""

    remote: RemoteInvoke | None

    async def invoke(
        self,
        function: str,
        qualifier: str,
        payload: bytes,
        *,
        client_context: str = "",
        trace_id: str = "",
        kind: str = "request",
        robot: str = "",
        request_id: str = "",
    ) -> Invoked:
        """Call one, and wait for what comes of it."""


class FunctionRequests:
    """Runs function calls of peers where functions are enabled; sends its own to a peer where they are not."""

    def __init__(self, mesh: Mesh, invoker: Invoker, *, on: bool) -> None:
        """`on`: functions run at this gateway."""
        self._mesh = mesh
        self._invoker = invoker
        self._on = on
        self._runners: dict[str, int] = {}  # the peers with functions; how many calls each has of ours
        mesh.on_message(OFFER, self._on_offer)
        mesh.on_peer(self._on_peer)
        if on:
            mesh.on_request(INVOKE, self._on_invoke)
        else:
            invoker.remote = self.invoke

    async def invoke(self, function: str, qualifier: str, payload: bytes, call: Call) -> Invoked:
        """Have it called by the peer that has least to do for us.

        Raises:
            FunctionsOffError: no gateway that runs functions is there, or it went: whether it ran is not known then.
            ThrottledError, EngineClosedError, GatewayError: as the peer says.
        """
        runner = min(self._runners, key=lambda peer: self._runners[peer], default="")
        if not runner:
            raise FunctionsOffError("no gateway of this store runs functions now (this one has --no-functions)")
        if sum(self._runners.values()) >= AT_ONCE:  # other questions, as for leases, must not wait for functions
            raise ThrottledError(f"{AT_ONCE} calls wait for gateways that run functions already")
        head = {
            "function": function,
            "qualifier": qualifier,
            "kind": call.kind,
            "robot": call.robot,
            "request_id": call.request_id,
            "client_context": call.client_context,
            "trace_id": call.trace_id,
        }
        request = join([json.dumps(head).encode(), payload])
        self._runners[runner] += 1
        try:
            answer = await self._mesh.request(runner, INVOKE, request, timeout_s=FUNCTION_S + MARGIN_S)
        except (PeerGoneError, PeerTimeoutError) as error:
            raise FunctionsOffError(f"the gateway that ran it went before it answered: {error}") from error
        except PeerBusyError as error:
            raise ThrottledError("so much waits for the gateway that runs functions already") from error
        except PeerRefusedError as error:
            raise _known(error) from error
        finally:
            if runner in self._runners:
                self._runners[runner] -= 1
        return _invoked(answer)

    def _on_offer(self, sender: str, payload: bytes) -> None:
        self._runners.setdefault(sender, 0)

    def _on_peer(self, gateway: str, there: bool) -> None:
        if not there:
            self._runners.pop(gateway, None)
        elif self._on:
            self._mesh.send(gateway, OFFER, b"")

    async def _on_invoke(self, sender: str, request: bytes) -> bytes:
        head, payload = split(request)
        asked: dict[str, str] = json.loads(head)
        function, qualifier = asked.pop("function"), asked.pop("qualifier")
        try:
            invoked = await self._invoker.invoke(function, qualifier, payload, **asked)
        except ThrottledError as error:
            return join([json.dumps({"throttled": error.reason, "message": str(error)}).encode(), b"", b""])
        outcome = invoked.outcome
        facts: dict[str, Any] = {
            "version": invoked.version,
            "request_id": invoked.request_id,
            "error_type": outcome.error_type,
            "duration_ms": outcome.duration_ms,
            "init_ms": outcome.init_ms,
            "max_memory_mb": outcome.max_memory_mb,
            "content_type": outcome.content_type,
        }
        return join([json.dumps(facts).encode(), outcome.payload, outcome.log])


def _invoked(answer: bytes) -> Invoked:
    head, payload, tail = split(answer)
    facts = json.loads(head)
    if "throttled" in facts:
        raise ThrottledError(facts["message"], reason=facts["throttled"])
    version, request_id = facts.pop("version"), facts.pop("request_id")
    return Invoked(Outcome(payload=payload, log=tail, **facts), version, request_id)


def _known(error: PeerRefusedError) -> Exception:
    """An error of functions under its own name again: the Lambda API has names of AWS for them."""
    kind = KINDS.get(error.code)
    return kind(str(error)) if kind is not None else error
