"""What rules do: real receivers, a small desk of commands, and AWS as moto serves it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import orjson
import pytest

from gateway.automation.rules.secrets import Secrets, target_owner
from gateway.automation.rules.targets.alert import AlertTarget
from gateway.automation.rules.targets.aws import AwsTarget, MakeClient, aws_client
from gateway.automation.rules.targets.command import CommandTarget, PublishTarget
from gateway.automation.rules.targets.webhook import WebhookTarget
from gateway.domain.automation.delivery import Dead, Delivery, Done, Put, Result, Retry
from gateway.domain.fleet.command import DONE, ISSUED, Command
from gateway.domain.principal import Principal
from gateway.errors import LeaseRequiredError
from gateway.outbound.webhook import signature, signing_key
from metaros.clock import ManualClock
from tests.gateway.automation.rules.world import NOW, open_world
from tests.support.servers.receivers import http_receiver

MAKER = {"kind": "user", "id": "u1", "name": "ada", "role": "admin", "robots": ["*"]}
EVENT = {"source": "metaros", "detail-type": "metaros.robot.offline", "resources": [], "detail": {"robot": "r1"}}


def delivery(kind: str, payload: Any = EVENT, robot: str = "r1", maker: Any = MAKER, **fields: Any) -> Delivery:
    """What the queue hands over."""
    context = {"rule": "one", "revision": 1, "target": "t", "fields": fields, "maker": maker, "ended": False}
    put = Put(kind=kind, target="one/t", payload=orjson.dumps(payload), robot=robot, context=context)
    return Delivery(id="01J0000000000000000000000A", put=put, state="leased", born_ns=NOW, due_ns=NOW)


async def posted(tmp_path: Path, *answers: bytes, hosts: tuple[str, ...] = ("localhost",)) -> tuple[Result, list[Any]]:
    """Post to a receiver that answers so."""
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.answers += answers
        target = WebhookTarget(world.rules.secrets, clock=world.clock, private_hosts=hosts)
        done = await target.deliver(delivery("webhook", url=f"http://localhost:{receiver.port}/x"))
        return done, receiver.requests


async def test_a_webhook_is_signed_by_its_targets_secret(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        secrets: Secrets = world.rules.secrets
        secret = await secrets.make(target_owner("one", "t"))
        target = WebhookTarget(secrets, clock=world.clock, private_hosts=("localhost",))
        done = await target.deliver(delivery("webhook", url=f"http://localhost:{receiver.port}/x"))
        assert done == Done("204")
        ((line, headers, body),) = receiver.requests
        assert (line, orjson.loads(body)) == ("POST /x HTTP/1.1", EVENT)
        wanted = signature(signing_key(secret), body, message=headers["webhook-id"], at_s=NOW // 10**9)
        assert headers["webhook-signature"] == wanted


@pytest.mark.parametrize(
    ("answer", "result"),
    [
        (b"HTTP/1.1 500 No\r\n\r\n", Retry("webhook_failed", "the receiver answers 500")),
        (b"HTTP/1.1 503 No\r\n\r\n", Retry("webhook_failed", "the receiver answers 503", counts=False)),
        (b"HTTP/1.1 410 Gone\r\n\r\n", Dead("webhook_refused", "the receiver answers 410")),
        (
            b"HTTP/1.1 302 Go\r\nLocation: http://169.254.169.254/\r\n\r\n",
            Retry("webhook_failed", "the receiver answers 302"),
        ),
    ],
)
async def test_what_a_receiver_answers_decides(tmp_path: Path, answer: bytes, result: Result) -> None:
    done, requests = await posted(tmp_path, answer)
    assert (done, len(requests)) == (result, 1)


async def test_nothing_is_posted_into_a_private_network_unless_it_is_allowed(tmp_path: Path) -> None:
    done, requests = await posted(tmp_path, hosts=())
    assert (type(done), done.code if isinstance(done, Dead) else "", requests) == (Dead, "webhook_insecure", [])
    async with open_world(tmp_path, name="two") as world:
        target = WebhookTarget(world.rules.secrets, clock=world.clock)
        done = await target.deliver(delivery("webhook", url="https://localhost:1/x"))
        assert isinstance(done, Retry)
        assert "--webhook-private" in done.message


class Orders:
    """Keeps what is sent; answers with commands as they are told."""

    def __init__(self, state: str = DONE, lease: bool = False) -> None:
        self.sent: list[dict[str, Any]] = []
        self._state = state
        self._lease = lease

    async def send(
        self, robot: str, kind: str, request: Mapping[str, Any], principal: Principal, **more: Any
    ) -> Command:
        """Keep it."""
        if self._lease and not request.get("lease_id"):
            raise LeaseRequiredError("cmd_vel moves the robot")
        self.sent.append({"robot": robot, "kind": kind, "request": dict(request), "by": principal.name, **more})
        return Command(
            id="01J0000000000000000000000B",
            robot=robot,
            kind=kind,
            request="{}",
            wire=b"",
            issuer="user:u1",
            issued_by=principal.name,
            digest="",
            durable=more["durable"],
            timeout_ms=1,
            issued_ns=NOW,
            state=self._state,
        )

    async def wait(self, command_id: str, wait_s: float) -> Command:
        """It stays as it is."""
        return await self.send("r1", "again", {"lease_id": "x"}, Principal(kind="user", name="x"), durable=True)

    def is_actuator(self, robot: str, topic: str) -> bool:
        """cmd_vel is one."""
        return topic.endswith("cmd_vel")

    def waits_by_itself(self, kind: str) -> bool:
        """None does."""
        return False


async def test_a_command_is_durable_and_the_deliverys() -> None:
    orders = Orders()
    target = CommandTarget(orders, clock=ManualClock(wall_ns=NOW))
    request = {"service": "~/dock", "type": "std_srvs/srv/Trigger"}
    assert isinstance(await target.deliver(delivery("command", request, command="call_service")), Done)
    (sent,) = orders.sent
    assert (sent["robot"], sent["kind"], sent["request"], sent["durable"]) == ("r1", "call_service", request, True)
    assert (sent["by"], sent["idempotency"]) == ("rule one", "rule 01J0000000000000000000000A")


async def test_a_command_that_waits_for_its_robot_is_looked_at_again() -> None:
    target = CommandTarget(Orders(ISSUED), clock=ManualClock(wall_ns=NOW))
    done = await target.deliver(delivery("command", {"node": "x", "verb": "stop"}, command="node_verb"))
    assert (type(done), done.code if isinstance(done, Retry) else "") == (Retry, "command_waits")


async def test_an_actuator_needs_a_lease_and_is_never_durable() -> None:
    message = {"linear": {"x": 1.0}}
    target = PublishTarget(Orders(lease=True), clock=ManualClock(wall_ns=NOW))
    refused = await target.deliver(delivery("publish", message, topic="cmd_vel"))
    assert isinstance(refused, Dead)
    assert refused.code == "lease_required"
    orders = Orders(lease=True)
    target = PublishTarget(orders, clock=ManualClock(wall_ns=NOW))
    assert isinstance(await target.deliver(delivery("publish", message, topic="cmd_vel", lease_id="l1")), Done)
    assert orders.sent[0]["durable"] is False
    assert orders.sent[0]["request"] == {"topic": "cmd_vel", "lease_id": "l1", "message": message}


async def test_a_robot_out_of_the_makers_scope_is_never_reached() -> None:
    maker = {**MAKER, "robots": ["lab_*"]}
    target = CommandTarget(Orders(), clock=ManualClock(wall_ns=NOW))
    done = await target.deliver(delivery("command", {"verb": "stop"}, maker=maker, command="node_verb"))
    assert done == Dead("out_of_scope", "its robot is not in the scope of who made the rule")


async def test_an_alert_opens_and_is_over_after_its_time() -> None:
    reported: list[Any] = []

    class Manager:
        """Keeps what it is told."""

        def report(self, edges: Any) -> None:
            reported.extend(edges)

        async def save(self) -> None:
            """Nothing to store."""

    target = AlertTarget(Manager(), clock=ManualClock(wall_ns=NOW))
    asked = delivery("alert", {"detail": {"series": "a.b", "value": 3}}, severity="error", for_s=60)
    done = await target.deliver(asked)
    assert isinstance(done, Done)
    (later,) = done.puts
    assert (later.due_ns, later.context["ended"]) == (NOW + 60 * 10**9, True)
    await target.deliver(replace(asked, put=later))
    assert [(edge.change, edge.finding.cause, edge.finding.value) for edge in reported] == [
        ("opened", "rule:one", 3.0),
        ("cleared", "rule:one", 3.0),
    ]


@pytest.fixture(scope="module")
def make_client() -> Iterator[MakeClient]:
    """Makes clients of AWS as moto serves it, each service's once."""
    from moto.server import ThreadedMotoServer  # heavy

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as environment:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            environment.setenv(name, "testing")
        yield cache(partial(aws_client, endpoint=f"http://{host}:{port}"))
    server.stop()


async def test_aws_is_given_what_the_rule_fires_on(make_client: MakeClient) -> None:
    target = AwsTarget(make_client, region="eu-central-1")
    sqs, sns, s3, events = [make_client(name, "eu-central-1") for name in ("sqs", "sns", "s3", "events")]
    queue = sqs.create_queue(QueueName="happenings")["QueueUrl"]
    arn = sqs.get_queue_attributes(QueueUrl=queue, AttributeNames=["QueueArn"])["Attributes"]["QueueArn"]
    topic = sns.create_topic(Name="news")["TopicArn"]
    sns.subscribe(TopicArn=topic, Protocol="sqs", Endpoint=arn, Attributes={"RawMessageDelivery": "true"})
    s3.create_bucket(Bucket="kept", CreateBucketConfiguration={"LocationConstraint": "eu-central-1"})
    events.put_rule(Name="all", EventPattern='{"source": ["metaros"]}')
    events.put_targets(Rule="all", Targets=[{"Id": "q", "Arn": arn}])
    for fields in (
        {"service": "sqs", "queue_url": queue},
        {"service": "sns", "topic_arn": topic, "subject": "news"},
        {"service": "events"},
        {"service": "s3", "bucket": "kept", "prefix": "rules/"},
    ):
        done = await target.deliver(delivery("aws", **fields))
        assert isinstance(done, Done), (fields, done)
    bodies = []
    while len(bodies) < 3:
        found = sqs.receive_message(QueueUrl=queue, MaxNumberOfMessages=10, WaitTimeSeconds=5)["Messages"]
        bodies += [orjson.loads(item["Body"]) for item in found]
    assert [one["detail-type"] for one in bodies] == ["metaros.robot.offline"] * 3
    kept = s3.get_object(Bucket="kept", Key="rules/one/01J0000000000000000000000A.json")
    assert orjson.loads(kept["Body"].read()) == EVENT
    target.close()


async def test_lambda_is_called_as_an_event(make_client: MakeClient) -> None:
    calls: list[dict[str, Any]] = []

    def watched(service: str, region: str) -> Any:
        client = make_client(service, region)
        client.meta.events.register("before-call.lambda.Invoke", lambda params, **more: calls.append(params))
        return client

    target = AwsTarget(watched, region="eu-central-1")
    done = await target.deliver(delivery("aws", service="lambda", function="react", qualifier="live"))
    assert isinstance(done, Dead)  # moto has no such function, and says so
    (call,) = calls
    assert call["url_path"] == "/2015-03-31/functions/react/invocations"
    assert (call["query_string"], call["headers"]["X-Amz-Invocation-Type"]) == ({"Qualifier": "live"}, "Event")
    assert orjson.loads(call["body"]) == EVENT
    target.close()


async def test_what_is_not_there_is_dead(make_client: MakeClient) -> None:
    target = AwsTarget(make_client, region="eu-central-1")
    endpoint = make_client("sqs", "eu-central-1").meta.endpoint_url
    for fields in (
        {"service": "sqs", "queue_url": f"{endpoint}/000000000000/none"},
        {"service": "s3", "bucket": "none"},
        {"service": "sns", "topic_arn": "arn:aws:sns:eu-central-1:000000000000:none"},
    ):
        done = await target.deliver(delivery("aws", **fields))
        assert isinstance(done, Dead), (fields, done)
    target.close()


async def test_aws_that_cannot_be_reached_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "testing")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "testing")
    target = AwsTarget(partial(aws_client, endpoint="http://127.0.0.1:1"), region="eu-central-1")
    done = await target.deliver(delivery("aws", service="sqs", queue_url="http://127.0.0.1:1/q"))
    assert isinstance(done, Retry)
    assert done.code == "aws_unreachable"
    target.close()
