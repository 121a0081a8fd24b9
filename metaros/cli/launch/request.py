"""`metaros launch status|restart|stop`: ask the launchers of this domain."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.options import Format
from metaros.errors import ConfigError, PeerError, UnavailableError

if TYPE_CHECKING:
    from metaros.wire import WireSession

__all__ = ["request"]

_ANSWER_S = 15.0  # stopping a node may take its grace time
_STATUS_S = 3.0


def request(what: str, node: str, *, zenoh_port: int, domain: int, output: Format) -> None:
    """Send it, print the nodes as they are then."""
    from metaros.cli.launch.screen import status_rows
    from metaros.cli.shared.connection import open_graph_and_session
    from metaros.cli.shared.output import Output

    if what != "status" and not node:
        raise ConfigError(f"which node? metaros launch {what} NODE; metaros launch status lists them")
    with open_graph_and_session(zenoh_port, domain, spin_time=0.3) as (session, _):
        found = _ask(session, domain, {"do": "status"}, _STATUS_S)
        if not found:
            raise UnavailableError(f"no launcher answers on port {zenoh_port} in ROS domain {domain}")
        if what != "status":
            zid = _owner(found, node)
            found = _ask(session, domain, {"do": what, "node": node}, _ANSWER_S, zid=zid)
    out = Output(output)
    if out.json:
        out.objects(list(found.values()))
        return
    for answer in found.values():
        if "error" in answer:
            raise PeerError(str(answer["error"]))
        out.note(f"{answer['table']}  (pid {answer['pid']})")
        rows = [row for row in answer["nodes"] if what == "status" or row["name"] == node]
        out.table(("node", "state", "pid", "restarts", "last exit"), status_rows(rows), right=(2, 3))


def _owner(found: dict[str, dict[str, Any]], node: str) -> str:
    """The one launcher that keeps this node."""
    names = [row["name"] for answer in found.values() for row in answer["nodes"]]
    owners = [zid for zid, answer in found.items() if any(row["name"] == node for row in answer["nodes"])]
    if len(owners) == 1:
        return owners[0]
    if owners:
        raise ConfigError(f"{len(owners)} launchers have a node {node!r}")
    raise ConfigError(f"no launcher has a node {node!r}; there are: {', '.join(names)}")


def _ask(
    session: WireSession, domain: int, question: dict[str, str], timeout_s: float, *, zid: str = "*"
) -> dict[str, dict[str, Any]]:
    """The answers, by the Zenoh id of the launcher."""
    from metaros.cli.launch.keys import request_key

    answers = {}
    payload = json.dumps(question).encode()
    for reply in session.check_open().get(request_key(domain, zid), payload=payload, timeout=timeout_s):
        if reply.ok is not None:
            try:
                answer = json.loads(reply.ok.payload.to_bytes())
            except ValueError:
                continue
            if isinstance(answer, dict):
                answers[str(reply.ok.key_expr).split("/")[2]] = answer
    return answers
