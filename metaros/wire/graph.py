"""The graph: nodes and endpoints, by their liveliness tokens.

`GraphState` is the pure part: tokens in, answers out. `Graph` feeds it from a session: the tokens that exist when it
opens, and every change after, handled on a thread of its own so that no reader's callback runs on a Zenoh thread.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, filterfalse
from queue import SimpleQueue
from typing import Final

import zenoh

from metaros.errors import TokenError
from metaros.wire.liveliness_tokens import (
    PREFIX,
    EndpointKind,
    EndpointToken,
    NodeToken,
    parse_token,
    tokens_of_domain,
)
from metaros.wire.qos import QoSProfile
from metaros.wire.session import WireSession
from metaros.wire.thread_state import pin_thread_state

__all__ = ["EndpointInfo", "Graph", "GraphState", "NodeInfo"]

Token = NodeToken | EndpointToken
TokenListener = Callable[[Token, bool], None]
_log = logging.getLogger("metaros.wire.graph")
_FIRST_ANSWER_S: Final = 1.0
_YOUNG_LINK_S: Final = 0.05


@dataclass(frozen=True, slots=True)
class NodeInfo:
    """A node as the graph shows it."""

    name: str
    namespace: str
    full_name: str
    zid: str
    enclave: str = "/"


@dataclass(frozen=True, slots=True)
class EndpointInfo:
    """A publisher (MP), subscription (MS), service server (SS) or client (SC) as the graph shows it."""

    kind: EndpointKind
    node: str
    namespace: str
    topic: str
    type_name: str
    type_hash: str
    qos: QoSProfile
    qos_text: str
    gid: bytes
    zid: str
    backends: str | None

    @property
    def node_full_name(self) -> str:
        """`/ns/name` of the node that owns it."""
        return f"{self.namespace.rstrip('/')}/{self.node}"


class GraphState:
    """All tokens that are alive. Not thread-safe; `malformed` counts the keys that are no tokens."""

    def __init__(self) -> None:
        self.malformed = 0
        self._nodes: dict[str, NodeToken] = {}
        self._endpoints: dict[str, EndpointToken] = {}
        self._infos: dict[str, EndpointInfo] = {}
        self._on_topic: dict[str, dict[str, EndpointToken]] = {}

    def add(self, key: str) -> Token | None:
        """A token appeared; returns it when it is new and sound."""
        if key in self._nodes or key in self._endpoints:
            return None
        try:
            token = parse_token(key)
        except TokenError:
            self.malformed += 1
            return None
        if isinstance(token, NodeToken):
            self._nodes[key] = token
        else:
            self._endpoints[key] = token
            self._infos[key] = _info(token)
            self._on_topic.setdefault(token.topic, {})[key] = token
        return token

    def discard(self, key: str) -> Token | None:
        """A token went; returns it when it was known."""
        self._infos.pop(key, None)
        token = self._endpoints.pop(key, None)
        if token is None:
            return self._nodes.pop(key, None)
        on_topic = self._on_topic[token.topic]
        del on_topic[key]
        if not on_topic:
            del self._on_topic[token.topic]
        return token

    def keys(self) -> Iterator[str]:
        """Of every token."""
        return chain(self._nodes, self._endpoints)

    def nodes(self) -> list[NodeInfo]:
        """Every node, by name."""
        found = [NodeInfo(n.name, n.namespace, n.full_name, n.zid, n.enclave) for n in self._nodes.values()]
        return sorted(found, key=lambda node: (node.full_name, node.zid))

    def endpoints(self, topic: str | None = None, kind: str | None = None) -> list[EndpointInfo]:
        """Every endpoint, or those of one topic (or service), one kind."""
        keys = self._infos if topic is None else self._on_topic.get(topic, ())
        return [info for key in keys if (info := self._infos[key]).kind == kind or kind is None]

    def tokens(self, topic: str | None = None) -> list[EndpointToken]:
        """Every endpoint's token, or those of one topic (or service)."""
        return list((self._endpoints if topic is None else self._on_topic.get(topic, {})).values())


def _info(token: EndpointToken) -> EndpointInfo:
    node = token.node
    return EndpointInfo(
        kind=token.kind,
        node=node.name,
        namespace=node.namespace,
        topic=token.topic,
        type_name=token.type_name,
        type_hash=token.type_hash,
        qos=token.qos,
        qos_text=token.qos_text,
        gid=token.gid,
        zid=node.zid,
        backends=token.backends,
    )


class Graph:
    """The graph of one domain as a session sees it, its own entities included. Thread-safe."""

    def __init__(self, session: WireSession) -> None:
        self._session = session
        self._state = GraphState()
        self._changed = threading.Condition()
        self._listeners: list[Callable[[], None]] = []
        self._token_listeners: list[TokenListener] = []
        self._telling: list[int] = []  # threads that tell them of what the state has already
        self._own = f"{PREFIX}/{session.domain}/{session.zid}/"
        self._tells_own = False
        self._queue: SimpleQueue[zenoh.Sample | zenoh.Reply | threading.Event | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="metaros-graph", daemon=True)
        self._thread.start()
        self._declare()

    def _declare(self) -> None:
        liveliness = self._session.check_open().liveliness()
        keys = tokens_of_domain(self._session.domain)
        put, first = self._queue.put, threading.Event()
        # C functions: Zenoh calls them on the thread that declares, too, where Python code could lose a signal.
        callback = zenoh.handlers.Callback(pin_thread_state(put), indirect=False)
        self._subscriber = liveliness.declare_subscriber(keys, callback, history=True)
        answers = zenoh.handlers.Callback(put, partial(put, first), indirect=False)
        liveliness.get(keys, answers, timeout=_FIRST_ANSWER_S)
        first.wait(_FIRST_ANSWER_S + 0.1)
        if self._session.connected():  # a link this young may not have told its tokens yet
            self.wait_for(lambda: bool(self._state.nodes()), _YOUNG_LINK_S)

    def close(self) -> None:
        """Stop listening; the last state stays readable."""
        if self._thread.is_alive():
            if not self._session.closed:
                self._subscriber.undeclare()  # type: ignore[no-untyped-call]
            self._queue.put(None)
            if threading.current_thread() is not self._thread:
                self._thread.join()

    # -- writing ---------------------------------------------------------------------------------------------------

    def add_own(self, token: Token) -> None:
        """Show an entity of this session, at once. What Zenoh reports of such tokens, if it does, comes late.

        It would bring back for a moment what is gone already; from the first call on it is left aside.
        """
        self._tells_own = True
        self._apply([(str(token), True)])

    def discard_own(self, token: Token) -> None:
        """The reverse of `add_own`."""
        self._apply([(str(token), False)])

    def _is_own(self, key: str) -> bool:
        """Whether `add_own` and `discard_own` tell of it."""
        return self._tells_own and key.startswith(self._own)

    def _run(self) -> None:
        while True:
            items = [self._queue.get()]
            items += [self._queue.get() for _ in range(self._queue.qsize())]
            changes = [change for item in items if (change := _change(item)) is not None]
            self._apply([change for change in changes if not self._is_own(change[0])])
            for item in items:
                if item is None:
                    return
                if isinstance(item, threading.Event):
                    item.set()

    def _apply(self, changes: list[tuple[str, bool]]) -> None:
        events: list[tuple[Token, bool]] = []
        with self._changed:
            for key, alive in changes:
                token = self._state.add(key) if alive else self._state.discard(key)
                if token is not None:
                    events.append((token, alive))
            if not events:
                return
            self._telling.append(threading.get_ident())
            listeners, token_listeners = list(self._listeners), list(self._token_listeners)
        for token, alive in events:
            for token_listener in token_listeners:
                _guarded(lambda call=token_listener, t=token, a=alive: call(t, a))  # type: ignore[misc]
        with self._changed:
            self._telling.remove(threading.get_ident())
            self._changed.notify_all()
        for listener in listeners:
            _guarded(listener)

    # -- reading ---------------------------------------------------------------------------------------------------

    @property
    def malformed(self) -> int:
        """How many keys among the tokens could not be read."""
        return self._state.malformed

    def nodes(self) -> list[NodeInfo]:
        """Every node, by name."""
        with self._changed:
            return self._state.nodes()

    def endpoints(self, topic: str | None = None, kind: str | None = None) -> list[EndpointInfo]:
        """Every endpoint, or those of one topic (or service), one kind (MP, MS, SS, SC)."""
        with self._changed:
            return self._state.endpoints(topic, kind)

    def tokens(self, topic: str | None = None) -> list[EndpointToken]:
        """The tokens of every endpoint, or those of one topic (or service)."""
        with self._changed:
            return self._state.tokens(topic)

    def settle(self, timeout_s: float) -> bool:
        """Wait until all is here that the routers know now; False where they do not tell, or it is not in time.

        A peer is told of the graph bit by bit, and never that this was all. A client's question is answered in full.
        """
        snapshot = GraphState()
        try:
            with self._session.client() as client:
                for answer in client.liveliness().get(tokens_of_domain(self._session.domain), timeout=timeout_s):
                    if answer.ok is not None:
                        snapshot.add(str(answer.ok.key_expr))
        except zenoh.ZError:
            return False
        missing = set(filterfalse(self._is_own, snapshot.keys()))

        def is_here() -> bool:
            missing.difference_update(self._state.keys())
            return not missing

        return self.wait_for(is_here, timeout_s)

    def topics(self) -> dict[str, set[str]]:
        """The type names on every topic."""
        return _types(info for info in self.endpoints() if info.kind in ("MP", "MS"))

    def services(self) -> dict[str, set[str]]:
        """The type names of every service."""
        return _types(info for info in self.endpoints() if info.kind in ("SS", "SC"))

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback()` after every change, changes close together as one; returns how to stop that.

        It runs on the graph's thread, or on the thread that declares an entity of this session: keep it short.
        """
        with self._changed:
            self._listeners.append(callback)
        return lambda: self._forget(self._listeners, callback)

    def on_token(self, callback: TokenListener) -> Callable[[], None]:
        """Call `callback(token, alive)` for each token that comes or goes; otherwise as `on_change`."""
        with self._changed:
            self._token_listeners.append(callback)
        return lambda: self._forget(self._token_listeners, callback)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `condition()`, looked at after every change, is true; False when it is not in time.

        The listeners of tokens have been told by then: who waits for a peer finds what they opened for it.
        """
        own = threading.get_ident()
        with self._changed:
            told = self._changed.wait_for(
                lambda: all(thread == own for thread in self._telling) and condition(), timeout_s
            )
            return told or condition()

    def _forget(self, listeners: list[Callable[..., None]], callback: Callable[..., None]) -> None:
        with self._changed:
            if callback in listeners:
                listeners.remove(callback)


def _change(item: zenoh.Sample | zenoh.Reply | threading.Event | None) -> tuple[str, bool] | None:
    if isinstance(item, zenoh.Reply):
        return (str(item.ok.key_expr), True) if item.ok is not None else None
    if isinstance(item, zenoh.Sample):
        return str(item.key_expr), item.kind == zenoh.SampleKind.PUT
    return None


def _types(infos: Iterable[EndpointInfo]) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for info in infos:
        found.setdefault(info.topic, set()).add(info.type_name)
    return dict(sorted(found.items()))


def _guarded(call: Callable[[], None]) -> None:
    try:
        call()
    except Exception:
        _log.exception("a listener of the graph failed")
