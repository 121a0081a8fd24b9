"""Which actions there are in the graph, who serves them and who calls them."""

from __future__ import annotations

from typing import Any, Final

__all__ = [
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
]

NamesAndTypes = list[tuple[str, list[str]]]
_FEEDBACK: Final = "/_action/feedback"
_MESSAGE: Final = "_FeedbackMessage"


def get_action_client_names_and_types_by_node(
    node: Any, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """The actions that a node calls; NodeNameNonExistentError where there is no such node."""
    return _actions(node.get_subscriber_names_and_types_by_node(remote_node_name, remote_node_namespace, True))


def get_action_server_names_and_types_by_node(
    node: Any, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """The actions that a node serves; NodeNameNonExistentError where there is no such node."""
    return _actions(node.get_publisher_names_and_types_by_node(remote_node_name, remote_node_namespace, True))


def get_action_names_and_types(node: Any) -> NamesAndTypes:
    """All actions that somebody serves or calls."""
    return _actions(node.get_topic_names_and_types())


def _actions(topics: NamesAndTypes) -> NamesAndTypes:
    """By the feedback topics: their names without the end, the actions' types."""
    return [
        (name.removesuffix(_FEEDBACK), [type_name.removesuffix(_MESSAGE) for type_name in types])
        for name, types in topics
        if name.endswith(_FEEDBACK)
    ]
