"""What a shell completes beyond nouns, verbs and options, which typer knows: the names of robots."""

from __future__ import annotations

from metaros.errors import MetarosError

__all__ = ["robots"]

ROBOTS_S = 2.0  # a shell waits for it


def robots(incomplete: str) -> list[str]:
    """The robots whose names begin so, of the gateway that would be asked; none where it does not answer at once."""
    from metaros.cli.shared.gateway_http import GatewayClient, open_gateway

    try:
        http = GatewayClient(open_gateway("").url, timeout_s=ROBOTS_S)
        found = [str(item["id"]) for item in http.pages("/api/v1/robots", "robots")]
    except MetarosError:
        return []
    return [name for name in found if name.startswith(incomplete)]
