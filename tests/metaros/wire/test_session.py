"""Sessions and routers: what the environment says, who sits on the port."""

from __future__ import annotations

import os
import socket
import threading

import pytest

from metaros.errors import ClosedError, ConfigError, NameError_
from metaros.wire import WireSession, default_endpoint, domain_from, open_router, probe
from metaros.wire.session import session_config
from tests.support.waiting import wait_until


def test_the_environment_names_domain_and_port():
    assert domain_from({}) == 0
    assert domain_from({"ROS_DOMAIN_ID": "42"}) == 42
    assert default_endpoint({}) == "tcp/localhost:7447"
    assert default_endpoint({"METAROS_ZENOH_PORT": "7999"}) == "tcp/localhost:7999"
    for port in ("0", "70000", "x", "-1"):
        with pytest.raises(ConfigError, match="METAROS_ZENOH_PORT"):
            default_endpoint({"METAROS_ZENOH_PORT": port})


def test_a_session_is_set_up_as_rmw_zenoh_sets_up_its_own():
    config = session_config({})
    for key, value in {
        "mode": '"peer"',
        "scouting/multicast/enabled": "false",
        "scouting/gossip/enabled": "true",
        "timestamping/enabled": "true",
        "transport/shared_memory/enabled": "false",
        "transport/link/tx/queue/size/data": "16",
        "transport/link/tx/queue/size/data_low": "16",
        "transport/link/tx/queue/size/real_time": "2",
    }.items():
        assert str(config.get_json(key)).strip('"').lower() == value.strip('"'), key
    assert "localhost:7447" in str(config.get_json("connect/endpoints"))
    assert "localhost:0" in str(config.get_json("listen/endpoints"))


def test_a_file_and_overrides_are_honoured_in_that_order(tmp_path):
    path = tmp_path / "session.json5"
    path.write_text('{mode: "client", connect: {endpoints: ["tcp/localhost:1"]}, timestamping: {enabled: true}}')
    for uri in (str(path), path.as_uri()):
        environ = {"ZENOH_SESSION_CONFIG_URI": uri, "ZENOH_CONFIG_OVERRIDE": "transport/link/tx/lease=1234;"}
        config = session_config(environ, connect=["tcp/localhost:2"])
        assert "client" in str(config.get_json("mode"))
        assert "1234" in str(config.get_json("transport/link/tx/lease"))
        assert "localhost:2" in str(config.get_json("connect/endpoints"))
    with pytest.raises(ConfigError, match="ZENOH_SESSION_CONFIG_URI"):
        session_config({"ZENOH_SESSION_CONFIG_URI": str(tmp_path / "none.json5")})


def test_a_session_links_counts_and_closes(zenoh_router):
    session = WireSession(domain_id=3, connect=zenoh_router, environ={})
    assert (session.domain, session.connect) == (3, [zenoh_router])
    assert session.connected()
    assert [session.next_id(), session.next_id()] == [0, 1]
    assert "ZENOH_RUNTIME" not in os.environ
    session.close()
    session.close()
    assert not session.connected()
    with pytest.raises(ClosedError):
        session.check_open()


def test_a_session_without_a_router_opens_and_joins_when_one_comes(free_port):
    session = WireSession(connect=f"tcp/127.0.0.1:{free_port}", environ={})
    assert not session.connected()
    with open_router(free_port) as router:
        wait_until(session.connected)
        wait_until(lambda: router.links() == 1)
    wait_until(lambda: not session.connected())
    session.close()


def test_a_domain_out_of_range_is_refused(zenoh_router):
    with pytest.raises(NameError_):
        WireSession(domain_id=500, connect=zenoh_router)


def test_probe_tells_free_from_zenoh_from_foreign(free_port):
    assert probe(free_port) == "free"
    with open_router(free_port) as router:
        assert router.endpoint == f"tcp/127.0.0.1:{free_port}"
        assert probe(free_port) == "zenoh"
        with pytest.raises(ConfigError, match=str(free_port)):
            open_router(free_port)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        assert probe(silent.getsockname()[1], answer_s=0.1) == "foreign"
    with socket.create_server(("127.0.0.1", 0)) as rude:
        threading.Thread(target=lambda: [rude.accept()[0].close() for _ in range(2)], daemon=True).start()
        assert probe(rude.getsockname()[1]) == "foreign"
