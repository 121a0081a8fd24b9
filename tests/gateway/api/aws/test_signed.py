"""Who gets in at the Lambda API: nobody without a signature, whatever else they bring."""

from __future__ import annotations

import http.client
import json
from typing import Any

import boto3
import httpx
import pytest
from botocore import UNSIGNED
from botocore.auth import SigV4Auth
from botocore.awsrequest import AWSRequest
from botocore.config import Config
from botocore.credentials import Credentials
from botocore.exceptions import ClientError

from gateway.identity.local_key import LOCAL_KEY_FILE
from tests.support.gateways.lambda_gateway import LambdaGateway
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.waiting import wait_until

FUNCTIONS = "/lambda/2015-03-31/functions"


def refusal(client: Any) -> tuple[int, str]:
    """The status and the name with which a list is refused."""
    with pytest.raises(ClientError) as error:
        client.list_functions()
    response = error.value.response
    return response["ResponseMetadata"]["HTTPStatusCode"], response["Error"]["Code"]


def asking(served: LambdaGateway, **headers: str) -> httpx.Client:
    """A client that signs nothing."""
    url = served.ready.url
    return httpx.Client(base_url=url, trust_env=False, verify=TRUSTS_NOBODY, timeout=60, headers=headers)


def test_a_wrong_signature_is_refused_with_awss_names(served: LambdaGateway) -> None:
    key_id, secret = served.key()
    assert served.client((key_id, secret)).list_functions()["Functions"] == []
    assert refusal(served.client((key_id, secret[:-1] + "x"))) == (403, "InvalidSignatureException")
    assert refusal(served.client(("0" * 16, secret))) == (403, "UnrecognizedClientException")
    assert refusal(served.client(("../../etc", secret))) == (403, "IncompleteSignatureException")
    assert refusal(served.client(served.key(scopes=()))) == (403, "UnrecognizedClientException")
    unsigned = boto3.client(
        "lambda",
        endpoint_url=served.endpoint,
        region_name="local",
        config=Config(signature_version=UNSIGNED, proxies={}),
    )
    assert refusal(unsigned) == (403, "MissingAuthenticationTokenException")


def test_no_other_credential_counts(served: LambdaGateway) -> None:
    local = (served.folder / LOCAL_KEY_FILE).read_text().strip()
    with asking(served) as web:
        for headers in ({}, {"Authorization": f"Bearer {local}"}, {"Cookie": "metaros_session=x"}):
            answer = web.get(FUNCTIONS, headers=headers)
            assert (answer.status_code, answer.headers["x-amzn-errortype"]) == (
                403,
                "MissingAuthenticationTokenException",
            )
            assert answer.headers["x-amzn-requestid"]
            assert answer.json()["message"]
        assert web.get("/lambda/code/" + "0" * 64 + "-9999999999-" + "0" * 64).status_code == 403
        assert web.get(FUNCTIONS, headers={"Host": "evil.example"}).status_code == 403
        assert web.get(FUNCTIONS, headers={"Origin": "https://evil.example"}).status_code == 403


def test_no_form_of_a_page_does_anything(served: LambdaGateway) -> None:
    with asking(served) as web:
        for kind in ("application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "text/plain"):
            answer = web.post(FUNCTIONS, content=b"{}", headers={"Content-Type": kind})
            assert (answer.status_code, answer.headers["x-amzn-errortype"]) == (
                403,
                "MissingAuthenticationTokenException",
            )


def test_a_body_over_its_limit_is_not_waited_for(served: LambdaGateway) -> None:
    key_id, secret = served.key()
    host = served.ready.url.split("//")[1]
    for method, path, said in (
        ("POST", FUNCTIONS, 73 << 20),
        ("POST", f"{FUNCTIONS}/f/invocations", (6 << 20) + 1),
        ("PUT", f"{FUNCTIONS}/f/configuration", (256 << 10) + 1),  # parsed at one go, while nothing else is done
        ("POST", "/lambda/no/operation", (256 << 10) + 1),
    ):
        request = AWSRequest(method, served.ready.url + path, {"Host": host, "Content-Length": str(said)}, b"x")
        SigV4Auth(Credentials(key_id, secret), "lambda", "local").add_auth(request)
        connection = http.client.HTTPConnection(host, timeout=60)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in request.headers.items():
            connection.putheader(name, value)
        connection.endheaders()  # and not a byte of the body
        answer = connection.getresponse()
        assert (answer.status, answer.getheader("x-amzn-errortype")) == (413, "RequestTooLargeException")
        assert answer.getheader("connection") == "close"
        answer.read()
        connection.close()


def test_a_body_that_is_not_the_signed_one_reaches_nobody(served: LambdaGateway) -> None:
    key_id, secret = served.key()
    request = AWSRequest("POST", served.ready.url + FUNCTIONS, {"Host": served.ready.url.split("//")[1]}, b"{}")
    SigV4Auth(Credentials(key_id, secret), "lambda", "local").add_auth(request)
    with asking(served) as web:
        for body in (b"{ }", b"", b'{"FunctionName": "x"}' + b" " * (2 << 20)):
            answer = web.post(request.url, headers=dict(request.headers.items()), content=body)
            assert (answer.status_code, answer.headers["x-amzn-errortype"]) == (403, "InvalidSignatureException")
    incoming = served.folder / "functions" / "code" / "incoming"
    wait_until(lambda: list(incoming.iterdir()) == [])  # what came is gone a moment after the answer


def test_a_revoked_key_ends_at_once(served: LambdaGateway) -> None:
    key = served.key()
    client = served.client(key)
    client.list_functions()
    local = (served.folder / LOCAL_KEY_FILE).read_text().strip()
    with asking(served, Authorization=f"Bearer {local}") as web:
        assert web.delete(f"/api/v1/keys/{key[0]}").status_code == 200
        assert refusal(client) == (403, "UnrecognizedClientException")


def test_a_key_that_sees_some_robots_reaches_no_function(served: LambdaGateway) -> None:
    client = served.client(served.key("operator", robots=["sim_1"]))
    assert refusal(client) == (403, "AccessDeniedException")


def signed(served: LambdaGateway, method: str, path: str, body: bytes, **headers: str) -> httpx.Response:
    """What a signed request is answered."""
    key_id, secret = served.key()
    request = AWSRequest(method, served.ready.url + path, {"Host": served.ready.url.split("//")[1], **headers}, body)
    SigV4Auth(Credentials(key_id, secret), "lambda", "local").add_auth(request)
    with asking(served) as web:
        return web.request(method, request.url, headers=dict(request.headers.items()), content=body)


def test_what_is_no_operation_or_no_json_says_so(served: LambdaGateway) -> None:
    answer = signed(served, "GET", "/lambda/2015-03-31/nothing", b"")
    assert (answer.status_code, answer.headers["x-amzn-errortype"]) == (404, "UnknownOperationException")
    for body in (b"[1]", b"{", b'"text"', b'{"FunctionName": 7}', b'{"Code": {"ZipFile": "!"}}'):
        answer = signed(served, "POST", FUNCTIONS, body)
        assert (answer.status_code, bool(answer.json()["message"])) == (400, True), body
    answer = signed(served, "POST", FUNCTIONS, json.dumps({"New": 1}).encode())
    assert "New: is no member" in answer.json()["message"]


def test_changes_and_refusals_are_in_the_audit_log(served: LambdaGateway) -> None:
    key = served.key()
    refusal(served.client((key[0], "0" * 64)))
    with pytest.raises(ClientError):
        served.client(key).delete_function(FunctionName="none")
    local = (served.folder / LOCAL_KEY_FILE).read_text().strip()
    with asking(served, Authorization=f"Bearer {local}") as web:
        rows = web.get("/api/v1/audit?limit=50").json()
    reported = json.dumps(rows)
    assert "signature_wrong" in reported
    assert f'"{key[0]}"' in reported
    assert "functions.write" in reported
    assert key[1] not in reported
