"""The templates of `metaros function init`, run for real: the engine, HTTP receivers, moto's S3, a gateway's rules."""

from __future__ import annotations

import base64
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import boto3
import pytest
from moto.server import ThreadedMotoServer

from gateway.automation.functions.example_events import EXAMPLE_EVENTS
from gateway.automation.rules.document import read_rule
from gateway.cli.function.local import TEMPLATES, run_here
from gateway.cli.function.manifest import read_manifest
from gateway.cli.function.pack import pack
from gateway.cli.rule.file import read_rules
from gateway.domain.automation.rule import Maker
from metaros.automation.functions.calls import Outcome
from metaros.automation.rules.pattern import compile_pattern
from metaros.cdr import codec
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from metaros.limits import LIMITS
from tests.support.gateways.quick_boto import read_documents_once

read_documents_once()
FOLDER = Path(__file__).parents[3] / "gateway" / "automation" / "function_templates"
CHIEF = Maker(kind="user", id="u", name="chief", role="admin", robots=("*",))


async def run(template: str, event: Any, **environment: str) -> Outcome:
    """A template's function, called once."""
    said = read_manifest(FOLDER / template)
    settings = {name: said[name] for name in ("handler", "timeout_s", "memory_mb")}
    settings |= {"environment": {**said.get("environment", {}), **environment}}
    outcome, _ = await run_here(pack(FOLDER / template).data, template, json.dumps(event).encode(), settings)
    return outcome


@contextmanager
def receiver(answer: bytes) -> Iterator[tuple[int, list[tuple[str, dict[str, str], bytes]]]]:
    """An HTTP server that says the same to all, and keeps what came."""
    came: list[tuple[str, dict[str, str], bytes]] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("content-length", "0")))
            came.append((self.path, {name.lower(): value for name, value in self.headers.items()}, body))
            self.send_response(200)
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        do_GET = do_POST

        def log_message(self, *_arguments: Any) -> None:
            """Quiet."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield server.server_port, came
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_every_folder_is_a_template_with_its_parts() -> None:
    folders = {path.name for path in FOLDER.iterdir() if path.is_dir()}
    assert folders == set(TEMPLATES)
    for name in folders:
        held = {path.name for path in (FOLDER / name).iterdir()}
        assert held - {"__pycache__"} == {"README.md", "app.py", "function.yaml", "rules.yaml"}
        assert read_manifest(FOLDER / name)["name"] == name


@pytest.mark.parametrize("name", TEMPLATES)
def test_the_rules_of_a_template_are_good(name: str) -> None:
    first, *_ = [read_rule(document, maker=CHIEF) for document in read_rules(FOLDER / name / "rules.yaml")]
    assert first.name == name


def test_rules_fit_the_events_that_they_are_for() -> None:
    for name, event in (("hello", "robot_offline"), ("alert_to_webhook", "alert")):
        (rule,) = read_rules(FOLDER / name / "rules.yaml")
        assert compile_pattern(rule["pattern"]).matches(EXAMPLE_EVENTS[event].event)


async def test_hello_answers() -> None:
    outcome = await run("hello", EXAMPLE_EVENTS["robot_offline"].event)
    assert json.loads(outcome.payload) == {"seen": "metaros.robot.offline", "robot": "sim_1"}
    assert b"metaros.robot.offline about sim_1" in outcome.log


async def test_an_alert_is_reported_in_the_chat_and_nobody_else_is_reached() -> None:
    event = EXAMPLE_EVENTS["alert"].event
    with receiver(b"ok") as (port, came), receiver(b"no") as (other, nothing):
        url, egress = f"http://127.0.0.1:{port}/services/T0", f"127.0.0.1:{port}"
        outcome = await run("alert_to_webhook", event, CHAT_URL=url, METAROS_EGRESS=egress)
        assert outcome.ok, outcome.log
        refused = await run("alert_to_webhook", event, CHAT_URL=f"http://127.0.0.1:{other}/", METAROS_EGRESS=egress)
    ((path, headers, body),) = came
    message = json.loads(body)
    assert path.endswith("/services/T0")
    assert headers["idempotency-key"] == "e-4711"
    assert message["text"] == "▲ sim_1: Left motor overheats"
    assert message["attachments"][0]["text"] == "97.5 °C is above 95 °C"
    assert (refused.error_type, nothing) == ("HTTPError", [])


async def test_a_picture_comes_to_its_bucket() -> None:
    picture = bytes(range(256)) * 100
    said = CompressedImage(format="jpeg", data=list(picture))
    said.header.frame_id = "camera_left"
    event = json.loads(json.dumps(EXAMPLE_EVENTS["image"].event))
    detail = event["detail"]
    found = {"seq": detail["seq"], "cdr": base64.b64encode(codec(CompressedImage).encode(said)).decode()}
    page = json.dumps({"messages": [{"seq": 1, "cdr": ""}, found], "next": None}).encode()
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        _, port = server.get_host_and_port()
        endpoint = f"http://127.0.0.1:{port}"
        keys: dict[str, Any] = {"aws_access_key_id": "AKIA", "aws_secret_access_key": "s", "region_name": "us-east-1"}
        s3 = boto3.client("s3", endpoint_url=endpoint, **keys)
        s3.create_bucket(Bucket="pictures")
        with receiver(page) as (gateway, came):
            outcome = await run(
                "image_to_s3",
                event,
                S3_ENDPOINT=endpoint,
                GATEWAY_URL=f"http://127.0.0.1:{gateway}",
                GATEWAY_KEY="mrk_1_2",
                METAROS_EGRESS=f"127.0.0.1:{port}, 127.0.0.1:{gateway}",
            )
        assert outcome.ok, outcome.payload + outcome.log
        key = json.loads(outcome.payload)["key"]
        stored = s3.get_object(Bucket="pictures", Key=key)
        assert stored["Body"].read() == picture
        stored["Body"].close()
        s3.close()
    finally:
        server.stop()
    assert key == f"sim_1/sim_1/camera/image/compressed/{detail['stamp_ns']}.jpeg"
    assert stored["ContentType"] == "image/jpeg"
    ((path, headers, _),) = came
    query = parse_qs(urlsplit(path).query)
    assert (query["topic"], query["format"]) == (["/sim_1/camera/image/compressed"], ["cdr"])
    assert query["start"] == ["2026-01-01T00:00:00+00:00"]
    assert headers["authorization"] == "Bearer mrk_1_2"


async def test_a_low_battery_asks_for_the_dock_and_the_second_rule_hears_it() -> None:
    event = EXAMPLE_EVENTS["battery_low"].event
    outcome = await run("battery_low_dock", event)
    answer = json.loads(outcome.payload)
    assert answer == {"dock": True, "robot": "sim_1", "charge": 0.18}
    _, go = read_rules(FOLDER / "battery_low_dock" / "rules.yaml")
    arn = "arn:aws:lambda:local:000000000000:function:battery_low_dock:$LATEST"
    reported: dict[str, Any] = {
        "detail-type": "Lambda Function Invocation Result - Success",
        "detail": {"requestContext": {"functionArn": arn}, "responsePayload": answer},
    }
    assert compile_pattern(go["pattern"]).matches(reported)
    reported["detail"]["responsePayload"] = {**answer, "dock": False}
    assert not compile_pattern(go["pattern"]).matches(reported)
    rule = read_rule(go, maker=CHIEF)
    reported["detail"]["responsePayload"] = answer
    asked = rule.targets[0].transform.render(reported, rule.name, most_bytes=LIMITS.rule_payload_bytes)
    assert asked == {"service": "/sim_1/base/dock", "type": "std_srvs/srv/Trigger"}
