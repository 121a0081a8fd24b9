"""The Runtime API over a real socket: what may be asked in which state, and every refusal by its name."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import dataclasses
import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

import httpx
import pytest

from metaros.automation.functions.calls import Invocation, Outcome
from metaros.automation.functions.response_stream import ResponseStream
from metaros.automation.functions.runtime.runtime_api import Answer, RuntimeApi, event_head
from metaros.limits import LIMITS
from tests.support.waiting import wait_until_async

LIMITED = dataclasses.replace(LIMITS, function_response_bytes=1000, function_stream_bytes=5000)
CALL = Invocation(request_id="r1", payload=b'{"n": 1}', client_context='{"a":1}', trace_id="Root=1")
NEXT, RESPONSE, ERROR = "runtime/invocation/next", "runtime/invocation/r1/response", "runtime/invocation/r1/error"
STREAMING = {"Lambda-Runtime-Function-Response-Mode": "streaming"}


class Owner:
    """What the API told of the worker."""

    def __init__(self) -> None:
        self.ready = 0
        self.answers: list[Answer] = []
        self.init_errors: list[Answer] = []
        self.lost = 0

    def on_ready(self) -> None:
        self.ready += 1

    def on_answer(self, answer: Answer) -> None:
        self.answers.append(answer)

    def on_init_error(self, answer: Answer) -> None:
        self.init_errors.append(answer)

    def on_lost(self) -> None:
        self.lost += 1


class Worker:
    """A worker by hand."""

    def __init__(self, api: RuntimeApi, owner: Owner, port: int, client: httpx.AsyncClient) -> None:
        self.api, self.owner, self.port, self.client = api, owner, port, client
        self.writers: list[asyncio.StreamWriter] = []

    async def takes_call(self, *, stream: ResponseStream | None = None) -> httpx.Response:
        asked = asyncio.create_task(self.client.get(NEXT))
        before = self.owner.ready
        await wait_until_async(lambda: self.owner.ready > before)
        assert self.api.waits
        self.api.give(event_head(CALL, arn="arn:f", deadline_ms=123), CALL, stream=stream)
        return await asked

    async def post(self, path: str, body: bytes = b"{}", headers: Mapping[str, str] | None = None) -> tuple[int, str]:
        answer = await self.client.post(path, content=body, headers=dict(headers or {}))
        return answer.status_code, answer.json().get("errorType", "")

    async def send(self, data: bytes) -> asyncio.StreamReader:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        self.writers.append(writer)
        writer.write(data)
        return reader

    async def hang_up(self) -> None:
        """Close what `send` opened."""
        while self.writers:
            writer = self.writers.pop()
            writer.close()
            with contextlib.suppress(ConnectionError):
                await writer.wait_closed()


@asynccontextmanager
async def served() -> AsyncIterator[Worker]:
    owner = Owner()
    api = RuntimeApi(owner, limits=LIMITED)
    server = await asyncio.get_running_loop().create_server(api.connection, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    url = f"http://127.0.0.1:{port}/2018-06-01/"
    async with httpx.AsyncClient(base_url=url, timeout=30, verify=False) as client:  # so it reads no root certificates
        worker = Worker(api, owner, port, client)
        try:
            yield worker
        finally:
            await worker.hang_up()
    api.close()
    server.close()
    await server.wait_closed()
    await wait_until_async(lambda: not api._connections)


@pytest.fixture
async def worker() -> AsyncIterator[Worker]:
    async with served() as worker:
        yield worker


async def test_a_call_and_its_answer(worker: Worker) -> None:
    call = await worker.takes_call()
    assert call.content == CALL.payload
    reported = {name: value for name, value in call.headers.items() if name.startswith("lambda-")}
    assert reported == {
        "lambda-runtime-aws-request-id": "r1",
        "lambda-runtime-deadline-ms": "123",
        "lambda-runtime-invoked-function-arn": "arn:f",
        "lambda-runtime-trace-id": "Root=1",
        "lambda-runtime-client-context": '{"a":1}',
    }
    assert call.headers["content-type"] == "application/json"
    assert await worker.post(RESPONSE, b"[1]", {"Content-Type": "application/json"}) == (202, "")
    assert worker.owner.answers == [Answer(b"[1]")]
    await worker.takes_call()


async def test_who_reads_no_answers_is_asked_nothing_more(worker: Worker) -> None:
    """Else what it is answered would be kept in memory without a bound."""
    reader = await worker.send(b"GET /2018-06-01/ping HTTP/1.1\r\n\r\n")
    assert b"200" in await reader.readline()
    (connection,) = worker.api._connections
    connection.transport.set_write_buffer_limits(high=1000)
    connection.transport.write(b"x" * 20_000_000)  # more than the system holds for who does not read
    assert not connection.transport.is_reading()
    while not connection.transport.is_reading():
        assert await reader.read(1 << 20)


async def test_bodies_that_nobody_asked_for_are_not_kept(worker: Worker) -> None:
    await worker.takes_call()
    head = b"POST /2018-06-01/%s HTTP/1.1\r\nContent-Length: 800\r\n\r\n"
    targets = ("runtime/invocation/other/response", "runtime/init/error", RESPONSE, RESPONSE)
    readers = []
    for count, target in enumerate(targets, 1):
        readers.append(await worker.send(head % target.encode() + b"x" * 799))
        await wait_until_async(lambda count=count: len(worker.api._connections) == 1 + count)
    await wait_until_async(lambda: sum(c._reader._left_bytes == 1 for c in worker.api._connections) == 4)
    assert sum(connection._reader._kept_bytes for connection in worker.api._connections) == 799
    for writer in worker.writers:
        writer.write(b"x")
    heads = [(await reader.readline()).split()[1] for reader in readers]
    assert heads == [b"400", b"403", b"202", b"403"]
    assert worker.owner.answers == [Answer(b"x" * 800)]


async def test_an_error_of_a_call(worker: Worker) -> None:
    await worker.takes_call()
    headers = {"Lambda-Runtime-Function-Error-Type": "E", "Lambda-Runtime-Function-XRay-Error-Cause": "x" * 1_048_000}
    assert await worker.post(ERROR, b'{"errorType": "F"}', headers) == (202, "")
    assert worker.owner.answers == [Answer(b'{"errorType": "F"}', "E")]


@pytest.mark.parametrize(
    ("document", "found"),
    [
        (b'{"errorType": "F"}', "F"),
        (b"[", "Runtime.Unknown"),
        (b"[]", "Runtime.Unknown"),
        (b'{"errorMessage": "%s", "errorType": "F"}' % (b"x" * 100_000), "F"),
        (b'{"errorType": "F", "errorMessage": "%s"}' % (b"x" * 100_000), "F"),
        (b'{"x": [%s1], "errorType": 1}' % (b"{}," * 100_000), "Runtime.Unknown"),
    ],
)
async def test_the_type_of_an_error_is_read_of_its_document(worker: Worker, document: bytes, found: str) -> None:
    worker.api.limits = LIMITS
    await worker.takes_call()
    await worker.post(ERROR, document)
    assert worker.owner.answers[0].error_type == found


async def test_an_error_of_the_init(worker: Worker) -> None:
    headers = {"Lambda-Runtime-Function-Error-Type": "Runtime.X"}
    assert await worker.post("runtime/init/error", b"{}", headers) == (202, "")
    assert worker.owner.init_errors == [Answer(b"{}", "Runtime.X")]
    assert await worker.post("runtime/init/error") == (403, "InvalidStateTransition")
    assert (await worker.client.get(NEXT)).status_code == 403


async def test_no_error_of_the_init_once_it_is_over(worker: Worker) -> None:
    await worker.takes_call()
    assert await worker.post("runtime/init/error") == (403, "InvalidStateTransition")


async def test_states_and_ids(worker: Worker) -> None:
    assert await worker.post(RESPONSE) == (400, "InvalidRequestID")
    await worker.takes_call()
    assert await worker.post("runtime/invocation/r2/response") == (400, "InvalidRequestID")
    assert await worker.post("runtime/invocation/r1/other") == (400, "InvalidRequestID")
    refused = await worker.client.get(NEXT)
    assert (refused.status_code, refused.json()["errorType"]) == (403, "InvalidStateTransition")
    assert await worker.post(RESPONSE) == (202, "")
    assert await worker.post(RESPONSE) == (403, "InvalidStateTransition")
    assert await worker.post(ERROR) == (403, "InvalidStateTransition")
    assert len(worker.owner.answers) == 1


async def test_one_request_for_a_call_at_a_time(worker: Worker) -> None:
    asked = asyncio.create_task(worker.client.get(NEXT))
    await wait_until_async(lambda: worker.api.waits)
    assert (await worker.client.get(NEXT)).status_code == 403
    worker.api.give(event_head(CALL, arn="", deadline_ms=0), CALL)
    assert (await asked).status_code == 200


async def test_who_breaks_off_its_request_is_reported_of(worker: Worker) -> None:
    await worker.send(b"GET /2018-06-01/" + NEXT.encode() + b" HTTP/1.1\r\n\r\n")
    await wait_until_async(lambda: worker.api.waits)
    await worker.hang_up()
    await wait_until_async(lambda: worker.owner.lost == 1)
    assert not worker.api.waits


async def test_the_response_mode(worker: Worker) -> None:
    await worker.takes_call()
    wrong = {"Lambda-Runtime-Function-Response-Mode": "other"}
    assert await worker.post(RESPONSE, b"x", wrong) == (400, "Runtime.InvalidResponseModeHeader")
    assert worker.owner.answers == []
    assert await worker.post(RESPONSE, b"x", STREAMING) == (202, "")


async def test_an_answer_over_its_limit(worker: Worker) -> None:
    await worker.takes_call()
    assert await worker.post(RESPONSE, b"x" * 1001) == (413, "Function.ResponseSizeTooLarge")
    assert worker.owner.answers[0].error_type == "Function.ResponseSizeTooLarge"
    assert json.loads(worker.owner.answers[0].body)["errorType"] == "Function.ResponseSizeTooLarge"
    await worker.takes_call()


@pytest.mark.parametrize(
    ("method", "path", "status", "error_type"),
    [
        ("PUT", "/2020-08-15/logs", 202, "Logs.NotSupported"),
        ("PUT", "/2022-07-01/telemetry", 202, "Telemetry.NotSupported"),
        ("POST", "/2020-01-01/extension/register", 403, "Extension.NotSupported"),
        ("GET", "/2018-06-01/runtime/restore/next", 403, "InvalidStateTransition"),
        ("POST", "/2018-06-01/runtime/restore/error", 403, "InvalidStateTransition"),
        ("GET", "/other", 404, "NotFound"),
    ],
)
async def test_what_is_not_offered(worker: Worker, method: str, path: str, status: int, error_type: str) -> None:
    answer = await worker.client.request(method, f"http://127.0.0.1:{worker.port}{path}")
    assert (answer.status_code, answer.json()["errorType"]) == (status, error_type)


async def test_ping(worker: Worker) -> None:
    assert (await worker.client.get("ping")).text == "pong"


async def test_what_is_no_http_ends_the_connection(worker: Worker) -> None:
    reader = await worker.send(b"nonsense\r\n\r\n")
    assert b"BadRequest" in await reader.read()


async def ended(reader: asyncio.StreamReader) -> bool:
    """Whether the other side hangs up, without a word."""
    try:
        return await reader.read() == b""
    except ConnectionError:
        return True


async def test_connections_are_bounded(worker: Worker) -> None:
    ping = b"GET /2018-06-01/ping HTTP/1.1\r\n\r\n"
    readers = [await worker.send(ping) for _ in range(LIMITS.function_connections)]
    for reader in readers:
        assert await reader.readuntil(b"pong")
    assert await ended(await worker.send(ping))


async def streamed(worker: Worker, chunks: bytes) -> tuple[list[bytes], Answer]:
    stream = ResponseStream(asyncio.get_running_loop(), limits=LIMITED)
    await worker.takes_call(stream=stream)
    head = b"POST /2018-06-01/" + RESPONSE.encode() + b" HTTP/1.1\r\nTransfer-Encoding: chunked\r\n"
    reader = await worker.send(head + b"Lambda-Runtime-Function-Response-Mode: streaming\r\n\r\n" + chunks)
    if chunks.endswith(b"\r\n\r\n"):
        await reader.readuntil(b"\r\n\r\n")
    await worker.hang_up()
    await wait_until_async(lambda: worker.owner.answers)
    stream.end(Outcome(payload=b""))
    return [piece async for piece in stream if isinstance(piece, bytes)], worker.owner.answers[0]


async def test_a_streamed_answer(worker: Worker) -> None:
    pieces, answer = await streamed(worker, b"3\r\nabc\r\n1\r\nd\r\n0\r\n\r\n")
    assert b"".join(pieces) == b"abcd"
    assert (answer.error_type, answer.body) == ("", b"")


async def test_an_error_in_the_trailers(worker: Worker) -> None:
    body = base64.b64encode(b'{"errorMessage": "w"}')
    trailers = b"Lambda-Runtime-Function-Error-Type: E\r\nLambda-Runtime-Function-Error-Body: " + body + b"\r\n"
    pieces, answer = await streamed(worker, b"3\r\nabc\r\n0\r\n" + trailers + b"\r\n")
    assert b"".join(pieces) == b"abc"
    assert answer == Answer(b'{"errorMessage": "w"}', "E")


async def test_trailers_that_are_no_base64(worker: Worker) -> None:
    trailers = b"Lambda-Runtime-Function-Error-Type: E\r\nLambda-Runtime-Function-Error-Body: %%%\r\n"
    _, answer = await streamed(worker, b"0\r\n" + trailers + b"\r\n")
    assert (answer.error_type, json.loads(answer.body)["errorType"]) == ("E", "E")


async def test_a_stream_that_breaks_off(worker: Worker) -> None:
    pieces, answer = await streamed(worker, b"3\r\nabc\r\n5\r\nab")
    assert b"".join(pieces) == b"abcab"
    assert answer.error_type == "Runtime.TruncatedResponse"


async def test_a_stream_over_its_limit(worker: Worker) -> None:
    chunk = b"3e8\r\n" + b"x" * 1000 + b"\r\n"
    pieces, answer = await streamed(worker, chunk * 6 + b"0\r\n\r\n")
    assert len(b"".join(pieces)) <= 5000
    assert answer.error_type == "Function.ResponseSizeTooLarge"
