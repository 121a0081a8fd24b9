"""The gateway's settings in one table: every field has its default, its flag and one line of help."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass, field
from pathlib import Path

from gateway.domain.host_names import is_wildcard, machine_names, outward_address
from gateway.domain.networks import Network, parse_networks
from metaros.automation.functions.egress.rules import parse_bound
from metaros.errors import ConfigError, FieldError
from metaros.limits import LIMITS

__all__ = [
    "DEFAULT_API_GRPC_PORT",
    "DEFAULT_FOXGLOVE_PORT",
    "DEFAULT_GRPC_PORT",
    "DEFAULT_HTTP_PORT",
    "DEFAULT_ROSBRIDGE_PORT",
    "Settings",
    "default_data_dir",
    "is_loopback",
]

DEFAULT_HTTP_PORT = 8080
DEFAULT_GRPC_PORT = 8081
DEFAULT_API_GRPC_PORT = 8082
DEFAULT_FOXGLOVE_PORT = 8765
DEFAULT_ROSBRIDGE_PORT = 9090
MIB = 1024 * 1024
SANDBOXES = ("L0", "L1", "L2", "L3")
_FLEET = re.compile(r"[a-z0-9][a-z0-9.-]{0,62}")


def default_data_dir() -> Path:
    """Where the gateway keeps its data when nobody says."""
    return Path.home() / ".metaros" / "gateway"


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Checked when made. A port of None means: the default one, or a free one when that is taken; 0 a free one."""

    host: str = "127.0.0.1"
    port: int | None = None
    grpc_port: int | None = None  # of robots
    api_grpc_port: int | None = None  # of people's programs
    foxglove_port: int | None = None  # -1: no port of its own
    rosbridge_port: int | None = None
    assets_dir: Path | None = None  # files that viewers may fetch: meshes, maps
    alerts: bool = True  # whether robots are watched; alerts that are stored are shown all the same
    functions: bool = True  # whether functions run here; those that are stored are shown all the same
    sandbox_require: str = "L0"  # the least sandbox of functions; a gateway that has less does not start
    function_workers: int = LIMITS.function_workers  # processes of all functions
    function_egress: str = "public"  # where functions may ask to connect to: public, none, any, or patterns
    aws_endpoint: str = ""  # where destinations and targets of AWS are; "": AWS itself
    aws_region: str = ""  # of those whose ARN names none
    webhook_private: tuple[str, ...] = ()  # hosts, as globs, to which rules may post within a private network
    notify: Path | None = None  # a file that says where alerts are sent
    data_dir: Path = field(default_factory=default_data_dir)
    store_url: str = field(default="", repr=False)  # PostgreSQL; "": a file in the data directory
    objects_url: str = ""  # "": a directory in the data directory
    cluster: tuple[str, ...] = ()  # Zenoh routers between the gateways of this store; none: it is alone
    master_key: Path | None = None  # None: METAROS_MASTER_KEY names it, or it is in the data directory
    allow_hosts: tuple[str, ...] = ()
    allow_origins: tuple[str, ...] = ()
    anonymous: bool = True  # on loopback, who has not signed in may look
    fleet: str = ""  # in spiffe://FLEET/robot/ID; "": the first 12 characters of the store's id
    require_enrolment: bool = False  # no robot without an identity, on loopback either
    robot_certificate_s: float = 7 * 86_400.0
    ca_cert: Path | None = None  # an issuer made elsewhere, and its key; None: the gateway makes its own
    ca_key: Path | None = None
    oidc: Path | None = None  # a file that says where people sign in
    tls: str = "auto"  # "auto": beyond loopback, and with a pair of one's own; "on", "off"
    tls_cert: Path | None = None  # a certificate made elsewhere (its chain behind it), and its key
    tls_key: Path | None = None
    trusted_proxies: tuple[str, ...] = ()  # addresses and CIDR ranges whose X-Forwarded-… are believed
    retention_days: float = 7.0
    event_retention_days: float = 90.0
    retention_bytes: int = 4096 * MIB
    retention_rules: tuple[str, ...] = ()  # CLASS=AGE,SIZE
    store_queue_bytes: int = 256 * MIB
    tick_s: float = 0.005
    heartbeat_s: float = LIMITS.heartbeat_s  # a link that is silent for three of them is dead
    viewer_stall_s: float = LIMITS.viewer_stall_s
    robot_messages_per_s: int = 100_000  # of one robot, samples and rows alike; 0 = no limit
    robot_bytes_per_s: int = 64 * MIB
    requests_per_s: float = 500.0  # of one user or key; 0 = no limit, here and below
    anonymous_requests_per_s: float = 200.0  # of one address that has not signed in
    robot_requests_per_s: float = 100.0  # that change something on one robot, of everybody together
    sign_ins_per_min: float = 5.0  # that fail, from one address
    actuator_topics: tuple[str, ...] = ("**/cmd_vel",)
    drain_s: float = 1.0  # how long what is under way may take when the gateway ends; then it is cut
    drain_notice_s: float = 0.0  # before that, how long it is not ready and goes on
    log_format: str = "text"
    log_level: str = "warning"
    otlp: str = field(default="", repr=False)  # an OpenTelemetry collector's URL; "": none
    static_dir: Path = Path(__file__).parent / "static"

    def __post_init__(self) -> None:
        """Refuse what cannot work, naming the setting."""
        from gateway.cluster.routers import check_routers
        from gateway.store.engines import check_url
        from gateway.store.objects import check_objects_url  # heavy: a page of help needs none of it
        from gateway.store.retention import class_limits

        check_url(self.store_url)
        check_routers(self.cluster)
        if self.cluster and not self.store_url:
            raise ConfigError("--cluster needs --store postgresql://…: the gateways of a cluster share one store")
        check_objects_url(self.objects_url)
        class_limits(self.retention_rules)
        if min(self.retention_days, self.event_retention_days) <= 0 or self.retention_bytes < MIB:
            raise ConfigError(
                "--retention-days and --event-retention-days are more than 0, and --retention-mib at least 1"
            )
        if not 0.0 <= self.tick_s <= 0.1:
            raise ConfigError("--tick-ms is 0 to 100")
        if min(self.robot_messages_per_s, self.robot_bytes_per_s) < 0:
            raise ConfigError("--robot-messages-per-s and --robot-bytes-per-s are 0 (no limit) or more")
        asked = (
            self.requests_per_s,
            self.anonymous_requests_per_s,
            self.robot_requests_per_s,
            self.sign_ins_per_min,
        )
        if not all(0 <= rate < float("inf") for rate in asked):
            raise ConfigError(
                "--requests-per-s, --anonymous-requests-per-s, --robot-requests-per-s and --sign-ins-per-min are "
                "0 (no limit) or more"
            )
        if not 0.2 <= self.heartbeat_s <= 60.0:
            raise ConfigError("--heartbeat-s is 0.2 to 60")
        self._check_operations()
        self._check_functions()
        self._check_identity()

    def _check_operations(self) -> None:
        from gateway.ops.logs import FORMATS, LEVELS
        from gateway.ops.otlp import check_otlp

        check_otlp(self.otlp)
        if self.log_format not in FORMATS or self.log_level not in LEVELS:
            raise ConfigError(f"--log-format is {' or '.join(FORMATS)}, --log-level one of {', '.join(LEVELS)}")
        if not (0.0 <= self.drain_s <= 600.0 and 0.0 <= self.drain_notice_s <= 600.0):
            raise ConfigError("--drain-s and --drain-notice-s are 0 to 600")

    def _check_functions(self) -> None:
        if self.sandbox_require not in SANDBOXES:
            raise ConfigError(f"--sandbox-require is one of {', '.join(SANDBOXES)}")
        if not 1 <= self.function_workers <= LIMITS.function_workers:
            raise ConfigError(f"--function-workers is 1 to {LIMITS.function_workers}")
        try:
            parse_bound(self.function_egress, field="--function-egress")
        except FieldError as error:
            raise ConfigError(str(error)) from error

    def _check_identity(self) -> None:
        if self.tls not in ("auto", "on", "off"):
            raise ConfigError(f"--tls {self.tls}: it is auto, on or off")
        if self.fleet and _FLEET.fullmatch(self.fleet) is None:
            raise ConfigError(f"--fleet {self.fleet}: 1 to 63 of a-z, 0-9, '.' and '-', a letter or digit first")
        if not 86_400.0 <= self.robot_certificate_s <= 7 * 86_400.0:
            raise ConfigError("--robot-certificate-hours is 24 to 168")
        if (self.ca_cert is None) != (self.ca_key is None):
            raise ConfigError("--ca-cert and --ca-key go together")
        if (self.tls_cert is None) != (self.tls_key is None):
            raise ConfigError("--tls-cert and --tls-key go together")
        if self.tls_cert is not None and self.tls == "off":
            raise ConfigError("--tls off and --tls-cert contradict each other")
        if not parse_networks(self.trusted_proxies) and self.proxied_only:
            raise ConfigError(
                f"--host {self.host} with --tls off: passwords and pictures would cross the network in the open\n"
                "leave --tls off out, or name the proxy that ends TLS: --trusted-proxy ADDRESS"
            )

    @property
    def tls_on(self) -> bool:
        """Whether the gateway's ports speak TLS."""
        return self.tls == "on" or (self.tls == "auto" and (self.tls_cert is not None or not is_loopback(self.host)))

    @property
    def robots_tls(self) -> bool:
        """Whether the robots' port speaks TLS: beyond loopback always, no proxy of people's is before it."""
        return self.tls_on or not is_loopback(self.host)

    @property
    def proxies(self) -> tuple[Network, ...]:
        """Whose word about where a request comes from is believed."""
        return parse_networks(self.trusted_proxies)

    @property
    def proxied_only(self) -> bool:
        """Whether nobody but the proxies may connect: beyond loopback without TLS."""
        return not self.tls_on and not is_loopback(self.host)

    @property
    def enrolled_only(self) -> bool:
        """Whether every robot needs an identity: beyond loopback always."""
        return self.require_enrolment or not is_loopback(self.host)

    @property
    def public_host(self) -> str:
        """By which name or address robots and people elsewhere best call the gateway; "" where there is none."""
        if is_loopback(self.host):
            return ""
        if self.allow_hosts:
            return self._allowed_names[0]
        if not is_wildcard(self.host):
            return self.host
        return next((name for name in (outward_address(), *machine_names()) if name), "")

    @property
    def server_names(self) -> tuple[str, ...]:
        """Which host names and addresses are this gateway's: in its own certificate, and in requests."""
        machine = () if is_loopback(self.host) else machine_names()
        own = ("localhost", "127.0.0.1", "::1", *(() if is_wildcard(self.host) else (self.host,)))
        return tuple(dict.fromkeys((*own, *self._allowed_names, *machine)))

    @property
    def _allowed_names(self) -> tuple[str, ...]:
        return tuple(re.sub(r"(?<=[^:]):[0-9]+$", "", name).strip("[]").lower() for name in self.allow_hosts)

    @property
    def anonymous_viewers(self) -> bool:
        """Whether somebody unknown on this machine is a viewer: beyond loopback never."""
        return self.anonymous and is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """True for localhost and the addresses that never leave this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
