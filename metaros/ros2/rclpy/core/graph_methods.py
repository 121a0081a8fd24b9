"""The part of an rclpy node that tells who else is there: what the graph shows now, without waiting."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from metaros.errors import NameError_
from metaros.node import Node as NativeNode
from metaros.ros2.rclpy.core.endpoint_info import (
    EndpointTypeEnum,
    ServiceEndpointInfo,
    TopicEndpointInfo,
    TopicEndpointTypeEnum,
)
from metaros.ros2.rclpy.core.rcl_errors import NodeNameNonExistentError
from metaros.ros2.rclpy.names.expand_topic_name import expand_topic_name
from metaros.ros2.rclpy.names.type_hash import TypeHash
from metaros.ros2.rclpy.names.validate_full_topic_name import validate_full_topic_name
from metaros.ros2.rclpy.names.validate_namespace import validate_namespace
from metaros.ros2.rclpy.names.validate_node_name import validate_node_name
from metaros.ros2.rclpy.names.validate_topic_name import validate_topic_name
from metaros.ros2.rclpy.qos.conversion import from_native
from metaros.wire.graph import EndpointInfo

__all__ = ["GraphMethods"]

NamesAndTypes = list[tuple[str, list[str]]]
_TOPIC_KINDS: Final = {"MP": TopicEndpointTypeEnum.PUBLISHER, "MS": TopicEndpointTypeEnum.SUBSCRIPTION}
_SERVICE_KINDS: Final = {"SC": EndpointTypeEnum.CLIENT, "SS": EndpointTypeEnum.SERVER}


class GraphMethods:
    """Questions about the graph, for `Node`; `handle` is the node of this library."""

    @property
    def handle(self) -> NativeNode:
        """The node of this library."""
        raise NotImplementedError

    # -- what there is ---------------------------------------------------------------------------------------------

    def get_topic_names_and_types(self, no_demangle: bool = False) -> NamesAndTypes:
        """Each topic with its types. `no_demangle` changes nothing: on this wire names are not mangled."""
        del no_demangle
        return _names_and_types(self._endpoints("MP", "MS"))

    def get_service_names_and_types(self) -> NamesAndTypes:
        """Each service that somebody serves or would call, with its types."""
        return _names_and_types(self._endpoints("SS", "SC"))

    def get_node_names(self) -> list[str]:
        """The name of each node, without its namespace."""
        return [name for name, _ in self.get_node_names_and_namespaces()]

    def get_fully_qualified_node_names(self) -> list[str]:
        """The name of each node with its namespace."""
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace in self.get_node_names_and_namespaces()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Each node's name and namespace."""
        return [(node.name, node.namespace) for node in self.handle.graph.nodes()]

    def get_node_names_and_namespaces_with_enclaves(self) -> list[tuple[str, str, str]]:
        """Each node's name, namespace and enclave."""
        return [(node.name, node.namespace, node.enclave) for node in self.handle.graph.nodes()]

    # -- what a node has -------------------------------------------------------------------------------------------

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """The topics that a node publishes, with their types; NodeNameNonExistentError where it is not there."""
        del no_demangle
        return self._by_node("MP", node_name, node_namespace)

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """The topics that a node subscribes to, with their types; NodeNameNonExistentError where it is not there."""
        del no_demangle
        return self._by_node("MS", node_name, node_namespace)

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """The services that a node serves, with their types; NodeNameNonExistentError where it is not there."""
        return self._by_node("SS", node_name, node_namespace)

    def get_client_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """The services that a node calls, with their types; NodeNameNonExistentError where it is not there."""
        return self._by_node("SC", node_name, node_namespace)

    # -- how many, and who -----------------------------------------------------------------------------------------

    def count_publishers(self, topic_name: str) -> int:
        """How many publishers a topic has; its name may be relative, and is remapped."""
        return self._count("MP", topic_name)

    def count_subscribers(self, topic_name: str) -> int:
        """How many subscriptions a topic has; its name may be relative, and is remapped."""
        return self._count("MS", topic_name)

    def count_clients(self, service_name: str) -> int:
        """How many clients a service has; its name may be relative, and is remapped."""
        return self._count("SC", service_name)

    def count_services(self, service_name: str) -> int:
        """How many servers a service has; its name may be relative, and is remapped."""
        return self._count("SS", service_name)

    def get_publishers_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[TopicEndpointInfo]:
        """The publishers of a topic. With `no_mangle` the name is taken as it stands: neither expanded nor remapped."""
        return self._topic_infos("MP", topic_name, no_mangle=no_mangle)

    def get_subscriptions_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[TopicEndpointInfo]:
        """The subscriptions of a topic; as for publishers."""
        return self._topic_infos("MS", topic_name, no_mangle=no_mangle)

    def get_clients_info_by_service(self, service_name: str, no_mangle: bool = False) -> list[ServiceEndpointInfo]:
        """The clients of a service; as for publishers."""
        return self._service_infos("SC", service_name, no_mangle=no_mangle)

    def get_servers_info_by_service(self, service_name: str, no_mangle: bool = False) -> list[ServiceEndpointInfo]:
        """The servers of a service; as for publishers."""
        return self._service_infos("SS", service_name, no_mangle=no_mangle)

    # -- names -----------------------------------------------------------------------------------------------------

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """The full name of a topic as this node means it, remapped unless `only_expand`.

        Raises:
            InvalidTopicNameException: it breaks the grammar.
            ValueError: it has a substitution that nobody knows.
        """
        return self._resolved(topic, service=False, only_expand=only_expand)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """The full name of a service as this node means it; InvalidServiceNameException, otherwise as for topics."""
        return self._resolved(service, service=True, only_expand=only_expand)

    def _resolved(self, name: str, *, service: bool, only_expand: bool) -> str:
        validate_topic_name(name, is_service=service)
        node = self.handle
        full_name = expand_topic_name(name, node.name, node.namespace)
        return full_name if only_expand else node.arguments.remapped(full_name, service=service)

    # -- reading the graph -----------------------------------------------------------------------------------------

    def _endpoints(self, *kinds: str) -> list[EndpointInfo]:
        return [info for info in self.handle.graph.endpoints() if info.kind in kinds]

    def _on(self, kind: str, name: str, *, no_mangle: bool = False) -> list[EndpointInfo]:
        """Those endpoints; ValueError where the name is none."""
        service = kind in _SERVICE_KINDS
        what = "service" if service else "topic"
        if not isinstance(name, str):
            raise TypeError(f"the name of a {what} is a text, not {name!r}")
        if not no_mangle:
            node = self.handle
            name = node.arguments.remapped(expand_topic_name(name, node.name, node.namespace), service=service)
            try:
                validate_full_topic_name(name, is_service=service)
            except NameError_ as error:
                raise ValueError(f"{what} name {name!r} is invalid: {error}") from None
        return self.handle.graph.endpoints(name, kind)

    def _count(self, kind: str, name: str) -> int:
        return len(self._on(kind, name))

    def _by_node(self, kind: str, node_name: str, node_namespace: str) -> NamesAndTypes:
        validate_node_name(node_name)
        validate_namespace(node_namespace)
        full_name = f"{node_namespace.rstrip('/')}/{node_name}"
        if all(node.full_name != full_name for node in self.handle.graph.nodes()):
            raise NodeNameNonExistentError(f"no node {full_name} is in the graph now: look at get_node_names()")
        return _names_and_types(info for info in self._endpoints(kind) if info.node_full_name == full_name)

    def _topic_infos(self, kind: str, name: str, *, no_mangle: bool) -> list[TopicEndpointInfo]:
        return [
            TopicEndpointInfo(
                node_name=info.node,
                node_namespace=info.namespace,
                topic_type=info.type_name,
                topic_type_hash=TypeHash.from_text(info.type_hash),
                endpoint_type=_TOPIC_KINDS[kind],
                endpoint_gid=list(info.gid),
                qos_profile=from_native(info.qos),
            )
            for info in self._on(kind, name, no_mangle=no_mangle)
        ]

    def _service_infos(self, kind: str, name: str, *, no_mangle: bool) -> list[ServiceEndpointInfo]:
        return [
            ServiceEndpointInfo(
                node_name=info.node,
                node_namespace=info.namespace,
                service_type=info.type_name,
                service_type_hash=TypeHash.from_text(info.type_hash),
                qos_profiles=[from_native(info.qos)],
                endpoint_gids=[list(info.gid)],
                endpoint_type=_SERVICE_KINDS[kind],
                endpoint_count=1,
            )
            for info in self._on(kind, name, no_mangle=no_mangle)
        ]


def _names_and_types(infos: Iterable[EndpointInfo]) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for info in infos:
        found.setdefault(info.topic, set()).add(info.type_name)
    return [(name, sorted(types)) for name, types in sorted(found.items())]
