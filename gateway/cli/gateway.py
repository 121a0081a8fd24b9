"""`metaros gateway`: the gateway's noun on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.backup import register as register_backup
from gateway.cli.options import (
    Cluster,
    DataDir,
    EventRetentionDays,
    MasterKeyFile,
    ObjectsUrl,
    RetentionDays,
    RetentionMib,
    RetentionRules,
    StoreUrl,
)
from gateway.cli.rekey import register as register_rekey
from gateway.cli.store.commands import register as register_store
from gateway.server.ports import NO_PORT
from gateway.settings import MIB, Settings, default_data_dir
from metaros.errors import ConfigError
from metaros.limits import LIMITS

__all__ = ["register"]

Host = Annotated[str, typer.Option(help="Address to listen on; beyond loopback with TLS and somebody to sign in.")]
Port = Annotated[
    int | None, typer.Option(min=0, max=65535, help="Port of dashboard and API; default 8080, or a free one.")
]
RobotsPort = Annotated[
    int | None, typer.Option(min=0, max=65535, help="Port robots connect to; default 8081, or a free one.")
]
ProgramsPort = Annotated[
    int | None, typer.Option(min=0, max=65535, help="Port of the API over gRPC; default 8082, or a free one.")
]
FoxglovePort = Annotated[
    str, typer.Option(metavar="PORT|off", help="Port of Foxglove's protocol; default 8765, or a free one.")
]
RosbridgePort = Annotated[
    str, typer.Option(metavar="PORT|off", help="Port of rosbridge's protocol; default 9090, or a free one.")
]
AssetsDir = Annotated[
    Path | None, typer.Option(file_okay=False, help="Files that viewers may fetch, such as meshes; none by default.")
]
Alerts = Annotated[bool, typer.Option("--alerts/--no-alerts", help="Whether robots are watched for what is wrong.")]
FunctionsOn = Annotated[bool, typer.Option("--functions/--no-functions", help="Whether functions run here.")]
SandboxRequire = Annotated[
    str,
    typer.Option(metavar="L0|L1|L2|L3", help="The least sandbox of functions; with less it does not start."),
]
FunctionWorkers = Annotated[int, typer.Option(min=1, max=LIMITS.function_workers, help="Processes of all functions.")]
FunctionEgress = Annotated[
    str, typer.Option(metavar="public|none|any|HOST[:PORT],…", help="Where functions may ask to connect to.")
]
AwsEndpoint = Annotated[str, typer.Option(metavar="URL", help="Where targets of AWS are called; default AWS itself.")]
WebhookPrivate = Annotated[
    list[str] | None, typer.Option(metavar="HOST", help="A host of a private network that rules may post to.")
]
AwsRegion = Annotated[str, typer.Option(metavar="REGION", help="The region of those that name none.")]
Notify = Annotated[Path | None, typer.Option(metavar="FILE", help="TOML: the webhooks and mails that alerts go to.")]
AllowHost = Annotated[list[str] | None, typer.Option(help="Another name browsers may call this gateway by.")]
AllowOrigin = Annotated[list[str] | None, typer.Option(help="Origin of another page that may use this gateway.")]
TickMs = Annotated[float, typer.Option(min=0.0, max=100.0, help="How long live samples wait to share one write.")]
HeartbeatS = Annotated[float, typer.Option(min=0.2, max=60.0, help="A link silent for three of these is dead.")]
RobotMessages = Annotated[int, typer.Option(min=0, help="Samples and rows a second from one robot; 0 = no limit.")]
RobotBytes = Annotated[int, typer.Option(min=0, help="Bytes of them a second from one robot; 0 = no limit.")]
Requests = Annotated[float, typer.Option(min=0.0, help="Requests a second of one user or key; 0 = no limit.")]
AnonymousRequests = Annotated[
    float, typer.Option(min=0.0, help="Requests a second of one address that has not signed in; 0 = no limit.")
]
RobotRequests = Annotated[
    float, typer.Option(min=0.0, help="Requests a second that change something on one robot; 0 = no limit.")
]
SignIns = Annotated[float, typer.Option(min=0.0, help="Failed sign-ins a minute from one address; 0 = no limit.")]
Anonymous = Annotated[
    bool, typer.Option("--anonymous/--no-anonymous", help="Who has not signed in may look, on this machine only.")
]
Fleet = Annotated[str, typer.Option(metavar="NAME", help="The fleet in robots' names; default: of the store's id.")]
RequireEnrolment = Annotated[bool, typer.Option("--require-enrolment", help="No robot gets in without an identity.")]
CaCert = Annotated[Path | None, typer.Option(dir_okay=False, help="PEM of an issuer made elsewhere, its root last.")]
CaKey = Annotated[Path | None, typer.Option(dir_okay=False, help="PEM of that issuer's key.")]
CertificateHours = Annotated[float, typer.Option(min=24.0, max=168.0, help="How long a robot's certificate is valid.")]
Oidc = Annotated[Path | None, typer.Option(metavar="FILE", help="JSON: the identity provider where people sign in.")]
Tls = Annotated[
    str, typer.Option(metavar="auto|on|off", help="TLS on every port; auto: beyond this machine, and with --tls-cert.")
]
TlsCert = Annotated[
    Path | None, typer.Option(dir_okay=False, help="PEM of a certificate made elsewhere, its chain behind it.")
]
TlsKey = Annotated[Path | None, typer.Option(dir_okay=False, help="PEM of its key, not encrypted.")]
TrustedProxy = Annotated[
    list[str] | None,
    typer.Option(metavar="CIDR", help="A proxy whose X-Forwarded-For and -Proto are believed; may be repeated."),
]
DrainS = Annotated[float, typer.Option(min=0.0, max=600.0, help="How long what is under way has when it ends.")]
DrainNoticeS = Annotated[
    float, typer.Option(min=0.0, max=600.0, help="How long it first says that it is not ready, for load balancers.")
]
LogFormat = Annotated[str, typer.Option(metavar="text|json", help="The log's lines: for people, or JSON objects.")]
LogLevel = Annotated[str, typer.Option(metavar="LEVEL", help="debug, info (every request), warning or error.")]
Otlp = Annotated[str, typer.Option(metavar="URL", help="OpenTelemetry collector for traces of followed samples.")]
StatusFile = Annotated[Path | None, typer.Option(metavar="FILE", help="Write this JSON file when ready.")]

# Options whose setting has another name, and those that may be repeated.
RENAMED = {"store": "store_url", "objects": "objects_url", "robot_certificate_hours": "robot_certificate_s"}
PLURAL = {
    "allow_host": "allow_hosts",
    "allow_origin": "allow_origins",
    "trusted_proxy": "trusted_proxies",
    "webhook_private": "webhook_private",
}


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    gateway = typer.Typer(invoke_without_command=True, help="Run the gateway: robots on one side, people on the other.")
    gateway.callback()(_gateway)
    register_store(gateway)
    register_backup(gateway)
    register_rekey(gateway)
    app.add_typer(gateway, name="gateway")


def _gateway(
    context: typer.Context,
    host: Host = "127.0.0.1",
    port: Port = None,
    grpc_port: RobotsPort = None,
    api_grpc_port: ProgramsPort = None,
    foxglove_port: FoxglovePort = "",
    rosbridge_port: RosbridgePort = "",
    assets_dir: AssetsDir = None,
    data_dir: DataDir = None,
    store: StoreUrl = "",
    objects: ObjectsUrl = "",
    cluster: Cluster = "",
    master_key: MasterKeyFile = None,
    allow_host: AllowHost = None,
    allow_origin: AllowOrigin = None,
    tls: Tls = "auto",
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    trusted_proxy: TrustedProxy = None,
    anonymous: Anonymous = True,
    oidc: Oidc = None,
    alerts: Alerts = True,
    notify: Notify = None,
    functions: FunctionsOn = True,
    sandbox_require: SandboxRequire = "L0",
    function_workers: FunctionWorkers = LIMITS.function_workers,
    function_egress: FunctionEgress = "public",
    aws_endpoint: AwsEndpoint = "",
    aws_region: AwsRegion = "",
    webhook_private: WebhookPrivate = None,
    fleet: Fleet = "",
    require_enrolment: RequireEnrolment = False,
    ca_cert: CaCert = None,
    ca_key: CaKey = None,
    robot_certificate_hours: CertificateHours = 168.0,
    retention_days: RetentionDays = 7.0,
    event_retention_days: EventRetentionDays = 90.0,
    retention_mib: RetentionMib = 4096,
    retention: RetentionRules = None,
    tick_ms: TickMs = 5.0,
    heartbeat_s: HeartbeatS = 5.0,
    robot_messages_per_s: RobotMessages = 100_000,
    robot_bytes_per_s: RobotBytes = 64 * MIB,
    requests_per_s: Requests = 500.0,
    anonymous_requests_per_s: AnonymousRequests = 200.0,
    robot_requests_per_s: RobotRequests = 100.0,
    sign_ins_per_min: SignIns = 5.0,
    drain_s: DrainS = 1.0,
    drain_notice_s: DrainNoticeS = 0.0,
    log_format: LogFormat = "text",
    log_level: LogLevel = "warning",
    otlp: Otlp = "",
    status_file: StatusFile = None,
) -> None:
    """Run the gateway until Ctrl-C."""
    given = {name: value for name, value in locals().items() if name not in ("context", "status_file")}
    if context.invoked_subcommand is None:
        _run(given, status_file)


def _run(given: dict[str, Any], status_file: Path | None) -> None:
    from gateway.main import run  # heavy: a page of help needs none of it

    run(_settings(given), status_file=status_file)


def _settings(given: dict[str, Any]) -> Settings:
    """The settings that the options mean."""
    chosen = {RENAMED.get(name, name): value for name, value in given.items()}
    chosen |= {plural: tuple(chosen.pop(option) or ()) for option, plural in PLURAL.items()}
    for name in ("foxglove_port", "rosbridge_port"):
        chosen[name] = _own_port(given[name], f"--{name.replace('_', '-')}")
    chosen["data_dir"] = given["data_dir"] or default_data_dir()
    chosen["cluster"] = tuple(part.strip() for part in given["cluster"].split(",") if part.strip())
    chosen["robot_certificate_s"] *= 3600.0
    chosen["retention_bytes"] = chosen.pop("retention_mib") * MIB
    chosen["retention_rules"] = tuple(chosen.pop("retention") or ())
    chosen["tick_s"] = chosen.pop("tick_ms") / 1000
    return Settings(**chosen)


def _own_port(text: str, flag: str) -> int | None:
    """What a port of a protocol's own is to be; ConfigError for what is none."""
    if not text:
        return None
    if text == "off":
        return NO_PORT
    if not (text.isascii() and text.isdigit() and len(text) < 6 and int(text) <= 65535):
        raise ConfigError(f"{flag} {text[:20]}: it is a port, 0 to 65535, or off")
    return int(text)
