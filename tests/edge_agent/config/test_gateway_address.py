"""Gateway addresses as people write them."""

from __future__ import annotations

import pytest

from edge_agent.config.gateway_address import parse_address
from metaros.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "authority", "link_url", "transports"),
    [
        ("host:8081", "host:8081", "ws://host:8081/api/v1/link", ("grpc", "websocket")),
        ("[::1]:8081", "[::1]:8081", "ws://[::1]:8081/api/v1/link", ("grpc", "websocket")),
        ("grpc://host", "host:8081", "ws://host:8081/api/v1/link", ("grpc",)),
        ("grpc://10.0.0.1:9", "10.0.0.1:9", "ws://10.0.0.1:9/api/v1/link", ("grpc",)),
        ("http://host", "host:80", "ws://host:80/api/v1/link", ("grpc", "websocket")),
        ("https://fleet.example/", "fleet.example:443", "wss://fleet.example:443/api/v1/link", ("grpc", "websocket")),
        ("https://host:8443/a/b", "host:8443", "wss://host:8443/a/b/api/v1/link", ("websocket",)),
    ],
)
def test_forms(text: str, authority: str, link_url: str, transports: tuple[str, ...]) -> None:
    address = parse_address(text)
    assert (address.text, address.authority, address.link_url, address.transports) == (
        text,
        authority,
        link_url,
        transports,
    )
    assert address.tls == text.startswith("https")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "nowhere",
        "host:",
        "host:0",
        "host:99999",
        "host:80/path",
        ":8081",
        "http://",
        "http://host:x",
        "http://u:p@host",
        "http://host?q=1",
        "http://host/#f",
        "http://host/a b",
        "http://host/../x/%2e",
        "ftp://host",
        "grpc://host/path",
        "ws://host",
        "::1:8081",
        "[::1",
    ],
)
def test_what_is_none_is_refused_with_the_forms(text: str) -> None:
    with pytest.raises(ConfigError, match="gateway"):
        parse_address(text)


def test_a_transport_may_be_demanded() -> None:
    address = parse_address("host:8081")
    assert address.only("auto") == address
    assert address.only("websocket").transports == ("websocket",)
    with pytest.raises(ConfigError, match="websocket"):
        parse_address("grpc://host").only("websocket")
    with pytest.raises(ConfigError, match="grpc"):
        parse_address("http://host/fleet").only("grpc")


def test_grpcs_is_grpc_alone_with_tls() -> None:
    address = parse_address("grpcs://fleet.example")
    assert (address.authority, address.tls, address.transports) == ("fleet.example:8081", True, ("grpc",))
    with pytest.raises(ConfigError, match="no path"):
        parse_address("grpcs://fleet.example/x")
