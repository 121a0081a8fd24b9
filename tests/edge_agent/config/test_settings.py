"""Settings: what a file may say, and errors that name key and file."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge_agent.config.settings import OutboxSettings, load_settings, sanitised_hostname
from edge_agent.config.topic_table import DEFAULT_TOPICS
from edge_agent.outbox import CLASSES
from metaros.errors import ConfigError
from metaros.limits import LIMITS

REPOSITORY = Path(__file__).resolve().parents[3]


def write(folder: Path, text: str) -> Path:
    path = folder / "agent.toml"
    path.write_text(text)
    return path


def test_defaults() -> None:
    settings = load_settings()
    assert settings.name == sanitised_hostname()
    assert (settings.namespace, settings.gateway, settings.zenoh_port) == ("/", "", 7447)
    assert [address.text for address in settings.addresses()] == ["127.0.0.1:8081"]
    assert settings.topics == DEFAULT_TOPICS
    assert settings.host_metrics


def test_the_example_file_loads() -> None:
    settings = load_settings(REPOSITORY / "examples" / "agent.toml")
    assert settings.name == "forklift_7"
    assert settings.topics[0].delivery == "bulk"
    assert settings.topics[-1] == DEFAULT_TOPICS[-1]
    assert settings.outbox.bulk_bytes == 128 << 20


def test_the_command_line_wins_and_none_means_not_given(tmp_path: Path) -> None:
    path = write(tmp_path, 'name = "a"\nnamespace = "/a"\nhost_metrics = false\n')
    settings = load_settings(
        path, {"name": "b", "namespace": None, "exclude": ["/x/**"], "status_file": tmp_path / "s"}
    )
    assert (settings.name, settings.namespace, settings.host_metrics) == ("b", "/a", False)
    assert settings.exclude == ("/x/**",)
    assert settings.status_file == tmp_path / "s"


def test_rows_come_before_the_default_table_or_instead_of_it(tmp_path: Path) -> None:
    rows = '[[topics]]\nmatch = "**/gps"\nclass = "bulk"\nmax_rate_hz = 5\nfields = ["latitude"]\n'
    topics = load_settings(write(tmp_path, rows)).topics
    assert (topics[0].match, topics[0].delivery, topics[0].max_rate_hz) == ("**/gps", "bulk", 5.0)
    assert topics[0].fields == ("latitude",)
    assert topics[1:] == DEFAULT_TOPICS
    assert len(load_settings(write(tmp_path, "default_topics = false\n" + rows)).topics) == 1


def test_several_gateways_and_how_to_speak_to_them(tmp_path: Path) -> None:
    text = "gateways = ['a:8081', 'https://b', 'a:8081']\ntransport = 'websocket'\ncompression = 'zstd'\n"
    settings = load_settings(write(tmp_path, text))
    assert settings.gateways == ("a:8081", "https://b")
    assert [address.link_url for address in settings.addresses()] == [
        "ws://a:8081/api/v1/link",
        "wss://b:443/api/v1/link",
    ]
    assert {address.transports for address in settings.addresses()} == {("websocket",)}
    assert settings.compression == "zstd"
    reported = load_settings(write(tmp_path, text), {"gateway": "c:1"})
    assert [address.text for address in reported.addresses()] == ["c:1"]


def test_quotas_and_sync_times_make_the_outboxs_classes(tmp_path: Path) -> None:
    text = "state_dir = '/var/lib/robot'\n[outbox]\nevent_bytes = 1000000\nmetric_sync_ms = 250\n"
    settings = load_settings(write(tmp_path, text))
    classes = settings.outbox.classes()
    assert settings.state_dir == Path("/var/lib/robot")
    assert (classes["event"].quota_bytes, classes["metric"].sync_s) == (1_000_000, 0.25)
    assert (classes["bulk"].quota_bytes, classes["bulk"].when_full) == (LIMITS.outbox_bulk_bytes, "drop")
    assert OutboxSettings().classes() == CLASSES


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nam = 'x'", "unknown key 'nam'"),
        ("name = 3", "name must be str"),
        ("zenoh_port = 0", "zenoh_port must be 1 to 65535"),
        ("zenoh_port = true", "zenoh_port must be int"),
        ("gateway = 'localhost'", "gateway must be HOST:PORT"),
        ("gateway = 'a:1'\ngateways = ['b:1']", "gateway or gateways, not both"),
        ("gateways = []", "gateways must name at least one"),
        ("gateways = ['a:1', 'ftp://b']", "gateway must be HOST:PORT"),
        ("transport = 'carrier pigeon'", "transport must be one of auto, grpc, websocket"),
        ("transport = 'websocket'\ngateway = 'grpc://a'", "cannot be reached by transport 'websocket'"),
        ("compression = 'gzip'", "compression must be one of none, zstd"),
        ("namespace = 'no slash'", "namespace"),
        ("exclude = '/a'", "exclude must be list"),
        ("exclude = ['/a b']", "exclude"),
        ("host_metrics = 1", "host_metrics must be bool"),
        ("[labels]\nsite = 1", "labels.site must be str"),
        ("[outbox]\nbulk = 1", "unknown key outbox.bulk"),
        ("[outbox]\nbulk_bytes = 1", "outbox.bulk_bytes must be at least 65536"),
        ("[outbox]\nevent_sync_ms = 0", "outbox.event_sync_ms must be 1 to 10000 ms"),
        ("[outbox]\nbulk_sync_ms = 1.5", "outbox.bulk_sync_ms must be int"),
        ("[[topics]]\nclass = 'live'", "topics[0].match is missing"),
        ("[[topics]]\nmatch = '**'\nclass = 'lively'", "topics[0].class must be one of"),
        ("[[topics]]\nmatch = '**'\nrate = 1", "unknown key topics[0].rate"),
        ("[[topics]]\nmatch = '**'\nmax_rate_hz = -1", "topics[0].max_rate_hz must be 0 to"),
        ("[[topics]]\nmatch = '**'\nmax_rate_hz = nan", "topics[0].max_rate_hz must be 0 to"),
        ("[[topics]]\nmatch = '**'\nforward = 'no'", "topics[0].forward must be bool"),
        ("[[topics]]\nmatch = '**'\nfields = [1]", "topics[0].fields must be str"),
        ("[[topics]]\nmatch = '**'\nfields = ['x']\ndeadband = -1", "topics[0].deadband must be 0 or more"),
        ("[[topics]]\nmatch = '**'\nfields = ['x']\ndeadband = inf", "topics[0].deadband must be 0 or more"),
        ("[[topics]]\nmatch = '**'\ndeadband = 0.5", "topics[0].deadband needs topics[0].fields"),
        ("[[topics]]\nmatch = '**'\ndeadband_max_s = -1", "topics[0].deadband_max_s must be 0 to"),
        ("[[topics]]\nmatch = '**'\nclass = 'event'\nlatest_only = true", "topics[0].latest_only cannot be"),
        ("[[topics]]\nmatch = '?'", "topics[0].match"),
        ("topics = 3", "topics must be list"),
        ("x = ", "agent.toml"),
    ],
)
def test_mistakes_name_the_key_and_the_file(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_settings(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml"):
        load_settings(tmp_path / "none.toml")


def test_a_wrong_option_is_named() -> None:
    with pytest.raises(ConfigError, match="command line: gateway"):
        load_settings(None, {"gateway": "nowhere"})
