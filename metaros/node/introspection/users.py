"""Who uses a type: the nodes of the graph that can be asked what it is, by its hash."""

from __future__ import annotations

from typing import Final, NamedTuple

from metaros.node.core import NodeCore
from metaros.node.introspection.described import ACTION_PARTS
from metaros.wire import EndpointInfo
from metaros.wire.names import NO_HASH

__all__ = ["ActionUser", "action_users", "hash_in_use", "part_of", "root_of", "users_of"]

_SEND_GOAL: Final = "/_action/send_goal"
_PLACES: Final = {"_GetResult": "/_action/get_result", "_FeedbackMessage": "/_action/feedback"}


class ActionUser(NamedTuple):
    """A node that serves or calls an action, with the hashes of `ACTION_PARTS` in its tokens."""

    node: str
    hashes: dict[str, str]


def root_of(type_name: str) -> str:
    """The action that has to be asked for: "pkg/action/X" of itself and of its services; "" for everything else."""
    if "/action/" not in type_name:
        return ""
    root = type_name.removesuffix("_SendGoal").removesuffix("_GetResult")
    return root if "_" not in root.rpartition("/")[2] else ""


def users_of(node: NodeCore, type_name: str, type_hash: str) -> list[str]:
    """The full names of the nodes that have endpoints of that type, publishers and servers first."""
    ends = [item for item in node.graph.endpoints() if (item.type_name, item.type_hash) == (type_name, type_hash)]
    ends.sort(key=lambda item: item.kind not in ("MP", "SS"))
    own = (node.context.zid, node.full_name)
    return list(dict.fromkeys(item.node_full_name for item in ends if (item.zid, item.node_full_name) != own))


def hash_in_use(node: NodeCore, type_name: str) -> str:
    """The hash under which the graph has a type, the first publisher's or server's; "" where nobody uses it.

    Of an action it is the hash of its X_SendGoal.
    """
    root = root_of(type_name)
    wanted = f"{root}_SendGoal" if root else type_name
    ends = [item for item in node.graph.endpoints() if item.type_name == wanted and item.type_hash != NO_HASH]
    ends.sort(key=lambda item: item.kind not in ("MP", "SS"))
    return ends[0].type_hash if ends else ""


def action_users(node: NodeCore, type_name: str, type_hash: str = "") -> list[ActionUser]:
    """The nodes that serve or call actions of a type, servers first; those alone that have all its parts.

    `type_name` may be that of a part, of which `type_hash` is then the hash.
    """
    action_type, own = root_of(type_name), (node.context.zid, node.full_name)
    first = [
        item
        for item in node.graph.endpoints()
        if item.type_name == f"{action_type}_SendGoal"
        and item.type_hash != NO_HASH
        and item.topic.endswith(_SEND_GOAL)
        and (item.zid, item.node_full_name) != own
    ]
    first.sort(key=lambda item: item.kind != "SS")
    found: dict[tuple[str, ...], ActionUser] = {}
    for end in first:
        hashes = {"_SendGoal": end.type_hash} | _rest(node, end, action_type)
        if len(hashes) == len(ACTION_PARTS) and type_hash in ("", hashes[part_of(type_name)]):
            found.setdefault((end.node_full_name, *hashes.values()), ActionUser(end.node_full_name, hashes))
    return list(found.values())


def part_of(type_name: str) -> str:
    """Which of `ACTION_PARTS` a hash that comes with the name of an action, or of a service of it, is that of."""
    return "_GetResult" if type_name.endswith("_GetResult") else "_SendGoal"


def _rest(node: NodeCore, end: EndpointInfo, action_type: str) -> dict[str, str]:
    """The hashes of the other parts, by the same node's endpoints."""
    hashes: dict[str, str] = {}
    for part, place in _PLACES.items():
        for item in node.graph.endpoints(end.topic.removesuffix(_SEND_GOAL) + place):
            same = (item.zid, item.node_full_name) == (end.zid, end.node_full_name)
            if same and item.type_name == action_type + part:
                hashes.setdefault(part, item.type_hash)
    return hashes
