"""The way to a gateway: whom the robot believes, to whom it shows its token, and how long it waits."""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from edge_agent.identity.gateway_http import verified
from edge_agent.update.errors import UpdateError
from edge_agent.update.fetch import TransferLimits
from edge_agent.update.source import Source
from metaros.clock import SystemClock
from tests.support.gateways.mtls_gateway import server_context
from tests.support.servers.fleet_ca import FleetCa
from tests.support.servers.tuf_repository import TufRepository, serve, utc


@pytest.fixture
def repository() -> TufRepository:
    found = TufRepository(utc(SystemClock().wall_ns()))
    found.add_agent("2.1.0")
    found.publish()
    return found


def source(folder: Path, url: str, tls: ssl.SSLContext) -> Source:
    """A robot's, with its token."""
    folder.mkdir(exist_ok=True)
    patience = TransferLimits(head_s=1.0, span_s=1.0, span_bytes=10_000)
    found = Source(folder, url, lambda: tls, SystemClock(), patience=patience)
    found.token = "mrf_secret"
    return found


def code(found: Source) -> str:
    """Why the bundle is not to be had; "" = it is."""
    try:
        with found.bundle("agent", "metaros", "2.1.0"):
            return ""
    except UpdateError as error:
        return error.code


def test_the_fleets_root_vouches_for_the_gateway(tmp_path: Path, repository: TufRepository) -> None:
    ca = FleetCa()
    with serve(repository, tls=server_context(ca, tmp_path)) as served:
        served.token = "mrf_secret"
        assert code(source(tmp_path / "update", served.url, verified(ca.roots))) == ""


def test_another_root_does_not_and_never_sees_the_token(tmp_path: Path, repository: TufRepository) -> None:
    with serve(repository, tls=server_context(FleetCa(), tmp_path)) as served:
        assert code(source(tmp_path / "update", served.url, verified(FleetCa().roots))) == "update_fetch"
        assert served.asked == []
    assert not (tmp_path / "update" / "root.json").exists()


def test_beyond_this_machine_there_is_no_way_without_tls(tmp_path: Path) -> None:
    assert code(source(tmp_path / "update", "http://192.0.2.1", ssl.create_default_context())) == "update_fetch"


def test_nobody_is_there(tmp_path: Path, free_port: int) -> None:
    assert (
        code(source(tmp_path / "update", f"http://127.0.0.1:{free_port}", ssl.create_default_context()))
        == "update_fetch"
    )


@contextmanager
def talker(words: bytes) -> Iterator[str]:
    """Says that, one byte every tenth of a second, to whoever connects, and then nothing."""
    end, listener = threading.Event(), socket.create_server(("127.0.0.1", 0))

    def talk() -> None:
        try:
            peer, _ = listener.accept()
        except OSError:
            return
        with peer:
            for byte in words:
                if end.wait(0.1):
                    return
                try:
                    peer.sendall(bytes([byte]))
                except OSError:
                    return
            end.wait(60)

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield f"https://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        end.set()
        listener.close()
        thread.join()


@pytest.mark.parametrize("words", [b"", b"\x16\x03\x03\x40\x00" + bytes(1000)], ids=["silent", "trickling"])
def test_a_handshake_without_an_end_is_cut(tmp_path: Path, words: bytes) -> None:
    with talker(words) as url:
        assert code(source(tmp_path / "update", url, ssl.create_default_context())) == "update_slow"


def test_a_first_root_that_is_none_is_not_pinned(tmp_path: Path, repository: TufRepository) -> None:
    whole = repository.files["metadata/1.root.json"]
    repository.sign_root(repository.root_keys[:1])
    with serve(repository) as served:
        found = source(tmp_path / "update", served.url, ssl.create_default_context())
        assert code(found) == "update_unsigned"
        repository.files["metadata/1.root.json"] = whole
        assert code(found) == ""


def test_a_root_that_was_shipped_is_believed_and_no_other(tmp_path: Path, repository: TufRepository) -> None:
    with serve(repository) as served:
        found = source(tmp_path / "update", served.url, ssl.create_default_context())
        evil = TufRepository(repository.now)
        (found.folder / "shipped_root.json").write_bytes(evil.files["metadata/1.root.json"])
        assert code(found) == "update_unsigned"
        assert "metadata/1.root.json" not in [path for path, _ in served.asked]
