"""Where an enrolled robot finds its gateway, and where it refuses to go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from edge_agent.config.settings import Settings
from edge_agent.errors import InsecureGatewayError
from edge_agent.identity.credentials import enrolled_addresses
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.key import key_to_pem, new_key
from edge_agent.main import resolve_gateways
from metaros.errors import ConfigError
from tests.support.servers.fleet_ca import FleetCa


def identity_at(url: str, **changes: object) -> RobotIdentity:
    """An identity that came from that URL."""
    ca, key = FleetCa(), new_key()
    identity = RobotIdentity(
        robot="arm",
        fleet=ca.fleet,
        url=url,
        system_trust=False,
        grpc_port=8081,
        grpc_tls=True,
        certificate=ca.robot(key.public_key(), "arm"),
        chain=ca.chain,
        roots=ca.roots,
        key=key_to_pem(key),
    )
    return replace(identity, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("url", "changes", "addresses"),
    [
        ("https://fleet.example:8080", {}, ["grpcs://fleet.example:8081", "https://fleet.example:8080"]),
        ("https://[::1]:8080", {}, ["grpcs://[::1]:8081", "https://[::1]:8080"]),
        ("http://127.0.0.1:8080", {"grpc_tls": False}, ["grpc://127.0.0.1:8081", "http://127.0.0.1:8080"]),
        ("https://fleet.example", {"grpc_tls": False}, ["https://fleet.example"]),
        ("https://fleet.example/x", {"grpc_port": 0}, ["https://fleet.example/x"]),
    ],
)
def test_the_gateway_of_the_enrolment_is_found(url: str, changes: dict[str, object], addresses: list[str]) -> None:
    assert [item.text for item in enrolled_addresses(identity_at(url, **changes), "auto")] == addresses


def test_a_transport_that_is_asked_for_is_the_only_one() -> None:
    identity = identity_at("https://fleet.example/x")
    assert [item.text for item in enrolled_addresses(identity, "websocket")] == ["https://fleet.example/x"]
    assert [item.text for item in enrolled_addresses(identity, "grpc")] == ["grpcs://fleet.example:8081"]


def test_a_robot_that_was_never_enrolled_goes_where_it_is_reported(tmp_path: Path) -> None:
    credentials, addresses = resolve_gateways(Settings(name="arm"), tmp_path)
    assert credentials is None
    assert [item.text for item in addresses] == ["127.0.0.1:8081"]


def test_what_is_reported_wins_over_the_enrolment(tmp_path: Path) -> None:
    IdentityFiles(tmp_path).save(identity_at("https://fleet.example:8080"))
    assert resolve_gateways(Settings(name="arm"), tmp_path)[1][0].text == "grpcs://fleet.example:8081"
    reported = Settings(name="arm", gateways=("https://a", "grpcs://b:1"))
    assert [item.text for item in resolve_gateways(reported, tmp_path)[1]] == ["https://a", "grpcs://b:1"]


@pytest.mark.parametrize("gateway", ["10.0.0.5:8081", "grpc://fleet.example", "http://fleet.example"])
def test_an_enrolled_robot_is_not_sent_away_without_tls(tmp_path: Path, gateway: str) -> None:
    IdentityFiles(tmp_path).save(identity_at("https://fleet.example"))
    with pytest.raises(InsecureGatewayError, match="TLS"):
        resolve_gateways(Settings(name="arm", gateway=gateway), tmp_path)
    for near in ("127.0.0.1:8081", "http://localhost:8080", "grpc://[::1]:8081"):
        assert resolve_gateways(Settings(name="arm", gateway=near), tmp_path)[0] is not None


def test_another_robots_state_directory_is_named(tmp_path: Path) -> None:
    IdentityFiles(tmp_path).save(identity_at("https://fleet.example"))
    with pytest.raises(ConfigError, match="--name arm"):
        resolve_gateways(Settings(name="leg"), tmp_path)
