"""What the chart says to a gateway is what the gateway's own code knows: options, environment, ports, probes, ends."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import click
import pytest
import typer

from gateway import settings as defaults
from gateway.api import route_paths
from gateway.api.authorization import RPC_PERMISSIONS
from gateway.identity.permissions import permission
from gateway.settings import Settings
from metaros.cli.main import build_app
from metaros.cli.shared.options import DEFAULT_ZENOH_PORT
from metaros.wire.router import other_routers
from tests.support.deployment.helm import SETS, rendered

PORTS = {
    "http": ("port", defaults.DEFAULT_HTTP_PORT),
    "robots": ("grpc_port", defaults.DEFAULT_GRPC_PORT),
    "programs": ("api_grpc_port", defaults.DEFAULT_API_GRPC_PORT),
    "foxglove": ("foxglove_port", defaults.DEFAULT_FOXGLOVE_PORT),
    "rosbridge": ("rosbridge_port", defaults.DEFAULT_ROSBRIDGE_PORT),
}
ENVIRONMENT = {"HOME", "TMPDIR", "POSTGRES_PASSWORD", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"}
OURS = ("gateway", "runner", "migrate", "zenoh")


@functools.cache
def metaros() -> click.Command:
    """The whole command."""
    found: click.Command = typer.main.get_command(build_app())
    return found


def command_of(arguments: list[str]) -> tuple[click.Command, dict[str, Any]]:
    """The command of `metaros` that takes these arguments, and what it makes of them; click refuses what is none."""
    command, rest = metaros(), list(arguments)
    while rest and rest[0] in (children := getattr(command, "commands", {})):
        command = children[rest.pop(0)]
    with command.make_context(command.name, rest, resilient_parsing=False) as context:
        return command, dict(context.params)


def containers() -> Iterator[tuple[str, str, dict[str, Any], dict[str, Any]]]:
    """Every container of ours in every set: set, component, container and pod."""
    for name in SETS:
        for _, pod in rendered(name).pods():
            component = pod["metadata"]["labels"]["app.kubernetes.io/component"]
            for container in (*pod["spec"].get("initContainers", ()), *pod["spec"]["containers"]):
                if component in OURS:
                    yield name, component, container, pod


def gateways() -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Every container that runs a gateway, and its pod."""
    for name, component, container, pod in containers():
        if component in ("gateway", "runner") and container["name"] == "gateway":
            yield f"{name} {component}", container, pod


def settings_of(container: dict[str, Any]) -> Settings:
    """As `metaros gateway` makes them; with a store, as it has in a cluster."""
    from gateway.cli.gateway import _settings

    _, given = command_of(container["args"])
    for name in ("context", "status_file"):
        given.pop(name, None)
    store = "postgresql://u@h/d" if any(item["name"] == "METAROS_STORE" for item in container["env"]) else ""
    return _settings({**given, "store": store})


def test_every_command_line_is_understood() -> None:
    seen = set()
    for name, component, container, _ in containers():
        command, _ = command_of(container["args"])
        seen.add((component, command.name))
        assert all(isinstance(text, str) for text in container["args"]), name
    assert {("gateway", "gateway"), ("runner", "gateway"), ("migrate", "migrate"), ("zenoh", "router")} <= seen


def test_an_option_that_does_not_exist_would_be_noticed() -> None:
    with pytest.raises(Exception, match="No such option: --drain-minutes"):
        command_of([*rendered("default").gateway()["args"], "--drain-minutes", "1"])
    with pytest.raises(Exception, match="valid integer"):
        command_of([*rendered("default").gateway()["args"], "--robot-bytes-per-s", "6.7e+07"])


def test_the_settings_are_those_that_the_gateway_would_start_with() -> None:
    for name, container, _ in gateways():
        made = settings_of(container)
        assert (made.host, made.enrolled_only, made.anonymous_viewers) == ("0.0.0.0", True, False), name
        assert made.tls_on is not name.startswith("proxy"), name
        assert made.functions is (("runner" in name) or name.split()[0] in ALONE_WITH_FUNCTIONS), name


ALONE_WITH_FUNCTIONS = {"default", "ha", "existing-secrets", "gateway-api", "no-ingress", "proxy"}


def test_what_is_not_set_is_as_the_gateway_has_it_by_itself() -> None:
    made, own = settings_of(rendered("default").gateway()), Settings()
    same = (
        *("alerts", "robot_messages_per_s", "robot_bytes_per_s", "requests_per_s", "anonymous_requests_per_s"),
        *("robot_requests_per_s", "sign_ins_per_min", "heartbeat_s", "robot_certificate_s", "sandbox_require"),
        *("function_workers", "function_egress", "retention_days", "event_retention_days", "retention_bytes"),
        *("fleet", "log_level", "otlp"),
    )
    assert {name: getattr(made, name) for name in same} == {name: getattr(own, name) for name in same}


def test_every_variable_of_the_environment_is_read() -> None:
    known = {
        variable
        for command in (command_of(["gateway"])[0], command_of(["gateway", "store", "migrate"])[0])
        for parameter in command.params
        for variable in ([parameter.envvar] if isinstance(parameter.envvar, str) else parameter.envvar or ())
    }
    found = {
        item["name"]
        for name, _, container, _ in containers()
        for item in container.get("env", ())
        if name != "all-on" or item["name"].startswith("METAROS")
    }
    assert {"METAROS_STORE", "METAROS_OBJECTS", "METAROS_MASTER_KEY"} <= found
    assert found - ENVIRONMENT <= known


def test_ports_are_the_gateways_and_every_one_that_it_opens_is_declared() -> None:
    for name, container, _ in gateways():
        made = settings_of(container)
        declared = {port["name"]: port["containerPort"] for port in container["ports"]}
        opened = {port: getattr(made, field) for port, (field, _) in PORTS.items()}
        assert declared == {port: number for port, number in opened.items() if number > 0}, name
    plain, full = rendered("default").gateway(), rendered("all-on").gateway()
    assert {port["name"] for port in plain["ports"]} == {"http", "robots", "programs"}
    assert {port["name"]: port["containerPort"] for port in full["ports"]} == {
        port: number for port, (_, number) in PORTS.items()
    }


def test_probes_ask_routes_that_exist_and_that_anybody_may_ask() -> None:
    for name, container, _ in gateways():
        made = settings_of(container)
        paths = {kind: container[f"{kind}Probe"]["httpGet"] for kind in ("startup", "liveness", "readiness")}
        assert {kind: probe["path"] for kind, probe in paths.items()} == {
            "startup": "/healthz",
            "liveness": "/healthz",
            "readiness": "/readyz",
        }
        for probe in paths.values():
            assert probe["path"] in route_paths()
            assert probe["scheme"] == ("HTTPS" if made.tls_on else "HTTP"), name
            (host,) = (item["value"] for item in probe["httpHeaders"] if item["name"] == "Host")
            assert host in made.server_names
    assert permission("health.read").who == "anyone"
    assert RPC_PERMISSIONS["/grpc.health.v1.Health/Check"] == "health.read"


def test_there_is_time_to_drain() -> None:
    for name, container, pod in gateways():
        made = settings_of(container)
        sleeps = container["lifecycle"]["preStop"]["sleep"]["seconds"]
        # gateway/drain.py: commands have drain_s, requests have it after them; robots' Goodbyes and what
        # detectors know take at most 10 s each.
        needed_s = sleeps + made.drain_notice_s + 2 * made.drain_s + 20
        assert pod["spec"]["terminationGracePeriodSeconds"] > needed_s + 5, name
        look = container["readinessProbe"]
        assert sleeps + made.drain_notice_s >= look["periodSeconds"] * look["failureThreshold"]
        starts = container["startupProbe"]
        assert starts["periodSeconds"] * starts["failureThreshold"] >= 60


def test_files_that_are_named_are_mounted_read_only_and_all_others_can_be_written() -> None:
    options = {"--tls-cert", "--tls-key", "--ca-cert", "--ca-key", "--oidc", "--notify"}
    for name, container, pod in gateways():
        arguments = container["args"]
        files = [arguments[place + 1] for place, text in enumerate(arguments) if text in options]
        files += [item["value"] for item in container["env"] if item["name"] == "METAROS_MASTER_KEY"]
        mounts = {mount["mountPath"]: mount for mount in container["volumeMounts"]}
        volumes = {volume["name"]: volume for volume in pod["spec"]["volumes"]}
        assert set(mounts.keys() - {"/assets"}) == {path.rpartition("/")[0] for path in files} | {
            "/tmp",
            "/var/lib/metaros",
        }, name
        for path in files:
            mount = mounts[path.rpartition("/")[0]]
            assert mount["readOnly"]
            assert volumes[mount["name"]]["secret"]["defaultMode"] == 0o400
        made = settings_of(container)
        assert str(made.data_dir).startswith("/var/lib/metaros/")
        environ = {item["name"]: item.get("value") for item in container["env"]}
        assert (environ["HOME"], environ["TMPDIR"]) == ("/var/lib/metaros", "/tmp")


def test_gateways_meet_at_routers_that_are_there() -> None:
    for name in SETS:
        found = rendered(name)
        routers = [item for item in found.of("StatefulSet") if item["metadata"]["name"].endswith("-zenoh")]
        for container in (found.gateway(), *([found.gateway("runner")] if is_there(name, "runner") else [])):
            meeting = settings_of(container).cluster
            if not routers:
                assert bool(meeting) is (name == "no-ingress")
                continue
            (item,) = routers
            assert list(meeting) == endpoints_of(item), name
    assert settings_of(rendered("no-ingress").gateway()).cluster == (
        "tcp/zenoh.plant.example:7447",
        "tcp/zenoh-2.plant.example:7448",
    )


def is_there(name: str, component: str) -> bool:
    """Whether a set has that component."""
    return any(
        pod["metadata"]["labels"]["app.kubernetes.io/component"] == component for _, pod in rendered(name).pods()
    )


def endpoints_of(router: dict[str, Any]) -> list[str]:
    """A pod each, by the name that its headless service gives it."""
    name, spec = router["metadata"]["name"], router["spec"]
    return [f"tcp/{name}-{ordinal}.{spec['serviceName']}.robots.svc:7447" for ordinal in range(spec["replicas"])]


def test_routers_know_each_other_and_not_themselves() -> None:
    for name in ("ha", "all-on"):
        item = rendered(name).one("StatefulSet", "-zenoh")
        (container,) = item["spec"]["template"]["spec"]["containers"]
        _, given = command_of(container["args"])
        assert (given["host"], given["port"]) == ("0.0.0.0", DEFAULT_ZENOH_PORT)
        every = endpoints_of(item)
        assert given["connect"] == every
        for ordinal, own in enumerate(every):
            pod = f"{item['metadata']['name']}-{ordinal}"
            others = other_routers(given["connect"], own_host=pod, port=given["port"])
            assert others == [endpoint for endpoint in every if endpoint != own]


def test_names_by_which_it_is_called_are_allowed() -> None:
    for name in SETS:
        found = rendered(name)
        hosts = set(settings_of(found.gateway()).allow_hosts)
        for service in found.of("Service"):
            if service["metadata"]["labels"]["app.kubernetes.io/component"] == "gateway":
                assert f"{service['metadata']['name']}.robots.svc" in hosts
        for item in found.of("Ingress"):
            assert {rule["host"] for rule in item["spec"]["rules"]} <= hosts
        for item in found.of("HTTPRoute", "GRPCRoute", "TLSRoute"):
            assert set(item["spec"]["hostnames"]) <= hosts


def test_a_change_of_the_configuration_rolls_the_pods() -> None:
    sums: dict[str, set[tuple[str, ...]]] = {}
    for _, container, pod in gateways():
        sums.setdefault(pod["metadata"]["annotations"]["checksum/config"], set()).add(tuple(container["args"]))
    assert all(len(arguments) == 1 for arguments in sums.values())
    assert len(sums) == len({tuple(container["args"]) for _, container, _ in gateways()})
