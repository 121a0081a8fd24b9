"""The client's pages: every verb of both clients is in the reference, and the how-to's code is code."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path

import metaros.client
from metaros.client import AsyncClient, Client

DOCS = Path(__file__).resolve().parents[3] / "docs"
REFERENCE = (DOCS / "reference/python_client.md").read_text()


def verbs(client: type) -> dict[str, list[str]]:
    """The public methods, and what each may be given by name."""
    found = inspect.getmembers(client, inspect.isfunction)
    return {name: list(inspect.signature(verb).parameters)[1:] for name, verb in found if not name.startswith("_")}


def test_both_clients_have_the_same_verbs() -> None:
    assert verbs(Client) == verbs(AsyncClient)


def test_every_verb_and_argument_is_in_the_reference() -> None:
    for name, arguments in verbs(Client).items():
        shown = re.search(rf"`{name}\((.*?)\)`", REFERENCE)
        assert shown is not None, name
        missing = [item for item in arguments if item not in ("options", "timeout_s") and item not in shown[1]]
        assert missing == [], f"{name}: {missing}"
    for name in inspect.signature(Client).parameters:
        assert f"| `{name}` |" in REFERENCE, name


def test_every_export_is_what_it_says() -> None:
    assert all(hasattr(metaros.client, name) for name in metaros.client.__all__)


def test_the_how_to_s_blocks_are_python() -> None:
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "howto/python_client.md").read_text(), re.DOTALL)
    assert len(blocks) >= 5
    for block in blocks:
        compile(block, "python_client.md", "exec")
        for name in re.findall(r"fleet\.(\w+)\(", block):
            assert name in verbs(Client), name


def test_the_base_install_is_enough() -> None:
    """None of what only the extras bring is imported."""
    extras = ("orjson", "fastapi", "uvicorn", "cbor2", "google.rpc", "grpc_status", "grpc_health", "cryptography")
    block = f"import sys; sys.modules.update(dict.fromkeys({extras!r}))"
    subprocess.run([sys.executable, "-c", f"{block}; import metaros.client"], check=True, timeout=120)
