"""Where the gateway is and who asks: argument, environment, context, this machine; in this order."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.access import contexts, credentials
from metaros.access.address import DEFAULT_URL
from metaros.client.access import find_access
from metaros.errors import ConfigError
from tests.support.tables import cases

KEY = "mrk_" + "1" * 16 + "_" + "2" * 64
OTHER = "mrk_" + "3" * 16 + "_" + "4" * 64


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user without any files."""
    for name in ("METAROS_KEY", "METAROS_CA", "METAROS_GATEWAY_URL", "METAROS_CONTEXT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    return tmp_path


def test_nothing_is_said_anywhere() -> None:
    access = find_access()
    assert (access.url, access.key, access.ca, access.headers) == (DEFAULT_URL, "", None, {})


def test_the_argument_wins_over_environment_and_context(monkeypatch: pytest.MonkeyPatch) -> None:
    with contexts.change() as kept:
        kept.add("lab", "https://lab.example")
        kept.current = "lab"
    assert find_access().url == "https://lab.example"
    monkeypatch.setenv("METAROS_GATEWAY_URL", "https://env.example:444/path")
    assert find_access().url == "https://env.example:444"
    assert find_access("fleet.example:9").url == "http://fleet.example:9"


def test_a_key_is_that_gateway_s_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    credentials.save_key("https://fleet.example", KEY)
    assert find_access("https://fleet.example").headers == {"authorization": f"Bearer {KEY}"}
    assert find_access("https://other.example").key == ""
    assert find_access("https://fleet.example", key="").key == ""
    monkeypatch.setenv("METAROS_KEY", OTHER)
    assert find_access("https://fleet.example").key == OTHER


def test_roots_of_a_file(home: Path) -> None:
    assert find_access("https://fleet.example").roots_pem() is None
    with pytest.raises(ConfigError):
        find_access("https://fleet.example", ca=home / "none.pem").roots_pem()
    (home / "root.pem").write_bytes(b"pem")
    assert find_access("https://fleet.example", ca=home / "root.pem").roots_pem() == b"pem"


@cases("text", ["ftp://x", "http://", "http://x:port"])
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(ConfigError, match="not the address"):
        find_access(text)


def test_an_address_of_ipv6() -> None:
    assert find_access("http://[::1]:8080").host == "[::1]"
