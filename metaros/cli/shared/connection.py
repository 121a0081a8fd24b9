"""Connect to the ROS graph: check the router, open a context, wait until the graph has settled."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from metaros.errors import UnavailableError

if TYPE_CHECKING:
    from metaros.node import Context
    from metaros.wire import Graph, WireSession

__all__ = ["absolute", "closest", "connect", "open_graph", "open_graph_and_session"]

_LINK_WAIT_S = 2.0
_MUCH_WORSE = 0.15  # names of one node are all alike: only those nearly as close as the closest are hints


@contextmanager
def open_graph(zenoh_port: int, domain: int, *, spin_time: float) -> Iterator[Graph]:
    """The graph alone, settled: for commands that only look. It loads no codec, so it is there sooner."""
    with open_graph_and_session(zenoh_port, domain, spin_time=spin_time) as (_, graph):
        yield graph


@contextmanager
def open_graph_and_session(zenoh_port: int, domain: int, *, spin_time: float) -> Iterator[tuple[WireSession, Graph]]:
    """The same, with the session to look further."""
    from metaros.wire import Graph, WireSession

    _check_port(zenoh_port)
    session = WireSession(domain_id=domain, connect=f"tcp/127.0.0.1:{zenoh_port}", shared_memory="off")
    try:
        _check_linked(session, zenoh_port)
        graph = Graph(session)
        try:
            if spin_time > 0:
                graph.settle(spin_time)
            yield session, graph
        finally:
            graph.close()
    finally:
        session.close()


@contextmanager
def connect(zenoh_port: int, domain: int, *, spin_time: float = 0.0) -> Iterator[Context]:
    """A context linked to the router on `zenoh_port`; with `spin_time`, its graph has settled."""
    _check_port(zenoh_port)
    from metaros.node import Context

    with Context(domain_id=domain, connect=f"tcp/127.0.0.1:{zenoh_port}", shared_memory="off") as context:
        _check_linked(context.session, zenoh_port)
        if spin_time > 0:
            context.graph.settle(spin_time)
        yield context


def _check_port(zenoh_port: int) -> None:
    """Fail at once where nobody listens."""
    from metaros.cli.shared.ports import port_accepts

    if not port_accepts(zenoh_port):
        where = f"no Zenoh router on 127.0.0.1:{zenoh_port}"
        raise UnavailableError(f"{where}\nstart one: `metaros up` (a whole fleet) or `metaros router`")


def _check_linked(session: WireSession, zenoh_port: int) -> None:
    """Somebody listens: is it a router?"""
    from metaros.cli.shared.ports import port_owner

    if not session.wait_linked(_LINK_WAIT_S):
        raise UnavailableError(
            f"127.0.0.1:{zenoh_port} is no Zenoh router: {port_owner(zenoh_port)} has the port\n"
            "start a router on another port: metaros router --port PORT, then use --zenoh-port PORT"
        )


def absolute(name: str) -> str:
    """A name as typed, from the root; NameError_ where it breaks ROS's grammar."""
    from metaros.idl import names

    return names.resolve(name, namespace="/", node="metaros_cli")


def closest(word: str, known: Iterable[str]) -> str:
    """ "did you mean …" in words, or nothing."""
    choices = sorted(known)
    near = difflib.get_close_matches(word, choices, n=3, cutoff=0.6)
    near = [name for name in near if _ratio(word, name) > _ratio(word, near[0]) - _MUCH_WORSE]
    near += [name for name in choices if name.rsplit("/", 1)[-1] == word.rsplit("/", 1)[-1] and name not in near]
    return f"did you mean {' or '.join(near[:3])}?" if near else ""


def _ratio(word: str, name: str) -> float:
    return difflib.SequenceMatcher(None, name, word).ratio()
