"""Keys of the user: each for its own gateway, in a file that is theirs alone."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from metaros.access.credentials import credentials_file, forget_key, key_for, save_key
from metaros.errors import ConfigError
from tests.support.tables import cases


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    monkeypatch.delenv("METAROS_KEY", raising=False)


def test_a_key_goes_to_its_own_gateway_only() -> None:
    save_key("http://127.0.0.1:8080", "mrk_a_1")
    save_key("https://fleet.example", "mrk_b_2")
    assert key_for("http://127.0.0.1:8080") == "mrk_a_1"
    assert key_for("localhost:8080") == "mrk_a_1"
    assert key_for("https://FLEET.example:443/robots") == "mrk_b_2"
    for other in (
        "http://127.0.0.1:8081",
        "https://127.0.0.1:8080",
        "http://fleet.example",
        "http://evil.example:8080",
    ):
        assert key_for(other) == ""


def test_a_local_gateway_s_key_is_read_where_it_is_now(tmp_path: Path) -> None:
    """Each start of that gateway makes another one."""
    url, file = "http://127.0.0.1:8080", tmp_path / "local.key"
    save_key(url, file)
    assert key_for(url) == ""
    for key in ("mrk_local_1", "mrk_local_2"):
        file.write_text(f"{key}\n")
        assert key_for(url) == key
    file.write_text("something else")
    assert key_for(url) == ""
    file.write_text("mrk_local_3")
    forget_key(url, file)
    assert key_for(url) == ""


def test_the_environment_goes_before_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    save_key("http://127.0.0.1:8080", "mrk_a_1")
    monkeypatch.setenv("METAROS_KEY", "mrk_c_3")
    assert key_for("http://anywhere") == "mrk_c_3"


@pytest.mark.skipif(os.name != "posix", reason="permission bits")
def test_only_the_owner_reads_it() -> None:
    save_key("http://127.0.0.1:8080", "mrk_a_1")
    assert credentials_file().stat().st_mode & 0o777 == 0o600
    credentials_file().chmod(0o644)
    with pytest.raises(ConfigError, match="chmod 600"):
        key_for("http://127.0.0.1:8080")


def test_forgetting_leaves_what_somebody_else_wrote() -> None:
    save_key("http://127.0.0.1:8080", "mrk_a_1")
    save_key("http://127.0.0.1:8081", "mrk_b_2")
    forget_key("http://127.0.0.1:8080", "mrk_other")
    assert key_for("http://127.0.0.1:8080") == "mrk_a_1"
    forget_key("http://127.0.0.1:8080", "mrk_a_1")
    assert key_for("http://127.0.0.1:8080") == ""
    assert key_for("http://127.0.0.1:8081") == "mrk_b_2"


def test_the_file_is_bounded_and_keeps_the_newest() -> None:
    for port in range(1, 101):
        save_key(f"http://127.0.0.1:{port}", f"mrk_{port}")
    assert len(json.loads(credentials_file().read_text())["gateways"]) == 64
    assert (key_for("http://127.0.0.1:36"), key_for("http://127.0.0.1:100")) == ("", "mrk_100")


def test_many_who_write_at_once_lose_nothing() -> None:
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda port: save_key(f"http://127.0.0.1:{port}", f"mrk_{port}"), range(1, 41)))
    assert [key_for(f"http://127.0.0.1:{port}") for port in range(1, 41)] == [f"mrk_{port}" for port in range(1, 41)]


@cases("text", ["", "{}", "[]", '{"gateways": 3}', "not json"])
def test_a_damaged_file_says_so(text: str) -> None:
    credentials_file().parent.mkdir(exist_ok=True)
    credentials_file().write_text(text)
    credentials_file().chmod(0o600)
    with pytest.raises(ConfigError, match="damaged"):
        key_for("http://127.0.0.1:8080")
