"""What `metaros up` decides beside real listeners and real claims."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from metaros.cli.shared.instances import DataDir, Instance, StateFile, open_data_dir
from metaros.cli.up.planning import UpOptions, claim, lost_ports, make_plan
from metaros.cli.up.screen import Screen
from metaros.clock import ManualClock
from metaros.errors import ConfigError


@pytest.fixture
def data(tmp_path: Path) -> DataDir:
    """A data directory of this test."""
    found = open_data_dir(tmp_path / "data")
    found.lock.close()
    return found


def options(free: list[int], **changes: object) -> UpOptions:
    """Explicit free ports, with changes."""
    values: dict[str, object] = {"port": free[0], "grpc_port": free[1], "zenoh_port": free[2]}
    return UpOptions(**{**values, **changes})  # type: ignore[arg-type]


@pytest.fixture
def free() -> list[int]:
    """Three free ports."""
    from tests.support.ports import free_port

    ports: set[int] = set()
    while len(ports) < 3:
        ports.add(free_port())
    return sorted(ports)


def test_free_ports_are_taken_as_asked(free: list[int], data: DataDir, clock: ManualClock) -> None:
    plan = make_plan(options(free, robots=2), data, Screen(clock=clock))
    assert [plan.http_port, plan.grpc_port, plan.zenoh_port] == free
    assert plan.own_router
    assert plan.simulated == ("sim_1", "sim_2")


def test_a_router_that_runs_is_joined(
    free: list[int], data: DataDir, clock: ManualClock, zenoh_router: str, capsys: pytest.CaptureFixture[str]
) -> None:
    port = int(zenoh_router.rsplit(":", 1)[1])
    plan = make_plan(options(free, zenoh_port=port), data, Screen(clock=clock))
    assert (plan.zenoh_port, plan.own_router) == (port, False)
    assert "joining it" in capsys.readouterr().out


def test_what_another_instance_claims_is_left_to_it(
    free: list[int], data: DataDir, clock: ManualClock, capsys: pytest.CaptureFixture[str]
) -> None:
    state = StateFile()
    state.write(
        Instance(
            pid=os.getpid(),
            state="starting",
            http_port=free[0],
            grpc_port=free[1],
            zenoh_port=free[2],
            robots=("sim_1", "sim_2", "desk"),
        )
    )
    try:
        with pytest.raises(ConfigError, match="another `metaros up`"):
            make_plan(options(free), data, Screen(clock=clock))
        plan = make_plan(options(free, port=None, grpc_port=None, robots=1), data, Screen(clock=clock))
        assert not plan.own_router
        assert plan.simulated == ("sim_3",)
        assert "sim_1 to sim_2 exist already" in capsys.readouterr().out
    finally:
        state.close()


@pytest.mark.parametrize("other", ["grpc_port", "zenoh_port"])
def test_one_port_for_two_services_is_an_error(free: list[int], data: DataDir, clock: ManualClock, other: str) -> None:
    with pytest.raises(ConfigError, match="are both"):
        make_plan(options(free, **{other: free[0]}), data, Screen(clock=clock))


def test_the_dashboard_may_have_the_link_s_default_port(
    data: DataDir,
    clock: ManualClock,
    capsys: pytest.CaptureFixture[str],
    free: list[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from metaros.cli.up import planning as up_decide

    monkeypatch.setattr(up_decide, "GRPC_PORT", free[0])  # whether 8081 is free is not this test's business
    plan = make_plan(options(free, port=free[0], grpc_port=None), data, Screen(clock=clock))
    assert plan.grpc_port > free[0]
    assert "in use by the dashboard" in capsys.readouterr().out


def test_who_moves_takes_no_port_that_another_service_is_to_have(
    data: DataDir, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    from metaros.cli.up import planning as up_decide
    from tests.support.ports import free_port

    first = free_port()
    monkeypatch.setattr(up_decide, "HTTP_PORT", first)
    monkeypatch.setattr(up_decide, "GRPC_PORT", first)
    plan = make_plan(UpOptions(zenoh_port=first + 1), data, Screen(clock=clock))
    assert len({plan.http_port, plan.grpc_port, plan.zenoh_port}) == 3
    again = make_plan(UpOptions(zenoh_port=first + 1), data, Screen(clock=clock), lost=[plan.grpc_port])
    assert again.grpc_port > plan.grpc_port


def test_a_port_that_was_lost_is_one_that_nobody_named(free: list[int], data: DataDir, clock: ManualClock) -> None:
    plan = make_plan(options(free), data, Screen(clock=clock))
    asked = options(free, port=None, zenoh_port=None)
    assert lost_ports(asked, plan, "gateway", ["Traceback"]) == []
    said = [f"error: port {port} cannot be opened: python (pid 1) has it" for port in free]
    assert lost_ports(asked, plan, "gateway", said) == [free[0]]
    assert lost_ports(asked, plan, "router", said) == [free[2]]
    assert lost_ports(asked, plan, "sim", said) == []
    with socket.socket() as other:
        other.bind(("127.0.0.1", free[0]))
        other.listen(1)
        assert lost_ports(asked, plan, "gateway", []) == [free[0]]


def test_the_claim_names_all_that_is_taken(free: list[int], data: DataDir, clock: ManualClock) -> None:
    claimed = claim(make_plan(options(free, robots=1, host_robot=False), data, Screen(clock=clock)), clock)
    assert (claimed.http_port, claimed.grpc_port, claimed.zenoh_port) == tuple(free)
    assert claimed.robots == ("sim_1",)
    assert claimed.state == "starting"


def test_replicas_get_ports_of_their_own(free: list[int], data: DataDir, clock: ManualClock) -> None:
    plan = make_plan(options(free, replicas=3, database="postgresql://h/d"), data, Screen(clock=clock))
    ports = [plan.http_port, plan.grpc_port, plan.zenoh_port, plan.cluster_port]
    ports += [port for replica in plan.replicas for port in (replica.http_port, replica.grpc_port)]
    assert len(set(ports)) == 8
    assert [replica.name for replica in plan.replicas] == ["gateway 2", "gateway 3"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"replicas": 2}, "--database"),
        ({"replicas": 6, "database": "postgresql://h/d"}, "1 to 5"),
        ({"replicas": 2, "database": "postgresql://h/d", "host": "0.0.0.0"}, "this machine alone"),
        ({"replicas": 2, "database": "postgresql://h/d", "tls": "on"}, "this machine alone"),
    ],
)
def test_replicas_need_a_database_and_stay_on_this_machine(
    free: list[int], data: DataDir, clock: ManualClock, changes: dict[str, object], said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        make_plan(options(free, **changes), data, Screen(clock=clock))
