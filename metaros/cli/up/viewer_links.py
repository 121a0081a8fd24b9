"""Where viewers of other makers connect to a gateway that runs here, and a link that opens one of them on it."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import quote, urlsplit

from metaros.cli.up.local_access import make_secret

__all__ = ["foxglove_page", "make_ticket", "socket_url", "viewer_ports"]

PAGE = "https://app.foxglove.dev/?ds=foxglove-websocket&ds.url="


def viewer_ports(status_file: Path) -> tuple[int, int]:
    """The ports of Foxglove and rosbridge, as the gateway's status file tells them; 0: it has none."""
    try:
        said = json.loads(status_file.read_text())
        return int(said.get("foxglove_port", 0)), int(said.get("rosbridge_port", 0))
    except (OSError, ValueError, AttributeError, TypeError):
        return 0, 0


def socket_url(url: str, port: int) -> str:
    """The address of a port beside a gateway's own, as viewers are given it."""
    parts = urlsplit(url)
    host = parts.hostname or "127.0.0.1"
    return f"{'wss' if parts.scheme == 'https' else 'ws'}://{f'[{host}]' if ':' in host else host}:{port}"


def foxglove_page(url: str, port: int, ticket: str) -> str:
    """A link that opens Foxglove in a browser on the gateway; its page gets in by the ticket alone."""
    place = socket_url(url, port)
    return PAGE + quote(f"{place}/?token={ticket}" if ticket else place, safe="")


def make_ticket(url: str, *, key: str, ca: Path | None = None) -> str:
    """A viewer's ticket for an hour; "" where the gateway gives none. Blocks: call it in a thread."""
    return make_secret(url, "/api/v1/auth/tickets", "ticket", key=key, ca=ca)
