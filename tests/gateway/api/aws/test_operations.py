"""Every management operation by boto3; each answer is checked against botocore's own shapes as it comes in."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import urllib.request
import zipfile
from typing import Any

import botocore.session
import pytest
from botocore import xform_name
from botocore.exceptions import ClientError

from gateway.automation.functions.catalogue.operations import OPERATIONS, REFUSED
from tests.gateway.api.aws.test_boto3 import call, make
from tests.support.gateways.lambda_gateway import HANDLER, ROLE, LambdaGateway, zipped

SOURCE_ARN = "arn:aws:metaros:::topic/rover-*/battery_state"


def test_every_operation_of_botocore_is_here_or_refused() -> None:
    names = set(botocore.session.get_session().get_service_model("lambda").operation_names)
    assert set(OPERATIONS) | set(REFUSED) == names
    assert not set(OPERATIONS) & set(REFUSED)
    assert len(OPERATIONS) >= 47


def test_what_is_refused_says_so_by_name(aws: Any) -> None:
    asked = {
        "GetFunctionRecursionConfig": {"FunctionName": "x"},
        "CreateFunctionUrlConfig": {"FunctionName": "x", "AuthType": "AWS_IAM"},
        "ListCodeSigningConfigs": {},
        "GetRuntimeManagementConfig": {"FunctionName": "x"},
        "ListCapacityProviders": {},
    }
    for operation, members in asked.items():
        with pytest.raises(aws.exceptions.InvalidParameterValueException) as refused:
            getattr(aws, xform_name(operation))(**members)
        assert f"{operation} is not implemented by Meta-ROS" in str(refused.value)


def test_code_is_fetched_by_a_link_and_updated(aws: Any, served: LambdaGateway) -> None:
    made = make(aws, "coded", HANDLER)
    code = aws.get_function(FunctionName="coded")["Code"]
    assert code["Location"].startswith(f"{served.ready.url}/lambda/code/")
    with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(code["Location"]) as answer:
        data = answer.read()
    assert base64.b64encode(hashlib.sha256(data).digest()).decode() == made["CodeSha256"]
    assert (len(data), zipfile.ZipFile(io.BytesIO(data)).namelist()) == (made["CodeSize"], ["app.py"])
    other = zipped("def handler(event, context):\n    return 'other'\n")
    dry = aws.update_function_code(FunctionName="coded", ZipFile=other, DryRun=True)
    assert (dry["CodeSize"], call(aws, "coded", 1)["Payload"]) == (len(other), 1)
    with pytest.raises(aws.exceptions.PreconditionFailedException):
        aws.update_function_code(FunctionName="coded", ZipFile=other, RevisionId="00000000")
    done = aws.update_function_code(FunctionName="coded", ZipFile=other, RevisionId=made["RevisionId"])
    assert done["RevisionId"] != made["RevisionId"]
    aws.get_waiter("function_updated_v2").wait(FunctionName="coded")
    assert call(aws, "coded", 1)["Payload"] == "other"


def test_settings_are_changed_one_by_one(aws: Any) -> None:
    make(aws, "set", Description="old", Timeout=7)
    done = aws.update_function_configuration(
        FunctionName="set",
        Environment={"Variables": {"MODE": "x"}},
        EphemeralStorage={"Size": 600},
        DeadLetterConfig={"TargetArn": "arn:aws:sqs:eu-central-1:123456789012:dead"},
        LoggingConfig={"LogFormat": "JSON", "ApplicationLogLevel": "INFO"},
    )
    assert (done["Description"], done["Timeout"], done["EphemeralStorage"]) == ("old", 7, {"Size": 600})
    assert done["DeadLetterConfig"]["TargetArn"].endswith(":dead")
    done = aws.update_function_configuration(FunctionName="set", Description="", DeadLetterConfig={"TargetArn": ""})
    assert (done["Description"], "DeadLetterConfig" in done, done["Environment"]) == (
        "",
        False,
        {"Variables": {"MODE": "x"}},
    )
    for members, named in (
        ({"Runtime": "nodejs22.x"}, "nodejs22.x"),
        ({"VpcConfig": {"SubnetIds": ["subnet-1"]}}, "VpcConfig"),
        ({"KMSKeyArn": "arn:aws:kms:eu-central-1:123456789012:key/1"}, "KMSKeyArn"),
        ({"TracingConfig": {"Mode": "Active"}}, "TracingConfig"),
        ({"SnapStart": {"ApplyOn": "PublishedVersions"}}, "SnapStart"),
        ({"Timeout": 5401}, "Timeout"),
        ({"MemorySize": 40_000}, "MemorySize"),
        ({"Environment": {"Variables": {"AWS_REGION": "x"}}}, "AWS_REGION"),
        ({"Environment": {"Variables": {"BIG": "x" * 4096}}}, "Environment"),
        ({"Environment": {"Variables": {"METAROS_EGRESS": "a.example, http://b"}}}, "'http://b' is no pattern"),
        ({"Handler": "has blanks"}, "Handler"),
        ({"Layers": ["arn:aws:lambda:local:000000000000:layer:none:1"]}, "layer:none:1"),
    ):
        with pytest.raises(aws.exceptions.InvalidParameterValueException, match=named):
            aws.update_function_configuration(FunctionName="set", **members)


def test_code_that_is_none_is_refused(aws: Any) -> None:
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        make(aws, "broken", Code={"ZipFile": b"no zip"})
    with pytest.raises(aws.exceptions.InvalidParameterValueException, match="ImageUri"):
        make(aws, "image", Code={"ImageUri": "x"}, PackageType="Zip")
    with pytest.raises(aws.exceptions.InvalidParameterValueException, match="S3Bucket"):
        make(aws, "bucket", Code={"S3Bucket": "somewhere", "S3Key": "x"})
    make(aws, "twice")
    with pytest.raises(aws.exceptions.ResourceConflictException):
        make(aws, "twice")


def test_versions_never_change(aws: Any) -> None:
    make(aws, "versioned", "def handler(event, context):\n    return 1\n")
    one = aws.publish_version(FunctionName="versioned", Description="the first")
    assert (one["Version"], one["Description"], one["FunctionArn"][-2:]) == ("1", "the first", ":1")
    assert aws.publish_version(FunctionName="versioned")["Version"] == "1"  # nothing has changed
    code = zipped("def handler(event, context):\n    return 2\n")
    assert aws.update_function_code(FunctionName="versioned", ZipFile=code, Publish=True)["Version"] == "2"
    assert [call(aws, "versioned", 0, Qualifier=str(number))["Payload"] for number in (1, 2)] == [1, 2]
    listed = aws.list_versions_by_function(FunctionName="versioned")["Versions"]
    assert [item["Version"] for item in listed] == ["$LATEST", "1", "2"]
    with pytest.raises(aws.exceptions.PreconditionFailedException):
        aws.publish_version(FunctionName="versioned", CodeSha256=base64.b64encode(b"x" * 32).decode())
    aws.delete_function(FunctionName="versioned", Qualifier="1")
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_function(FunctionName="versioned", Qualifier="1")
    aws.update_function_configuration(FunctionName="versioned", Description="three")
    assert aws.publish_version(FunctionName="versioned")["Version"] == "3"


def test_aliases_lead_to_versions(aws: Any) -> None:
    make(aws, "aliased", "def handler(event, context):\n    return context.function_version\n", Publish=True)
    aws.update_function_configuration(FunctionName="aliased", Description="more")
    aws.publish_version(FunctionName="aliased")
    made = aws.create_alias(FunctionName="aliased", Name="live", FunctionVersion="1", Description="what runs")
    assert call(aws, "aliased", 0, Qualifier="live")["ExecutedVersion"] == "1"
    assert call(aws, made["AliasArn"], 0)["Payload"] == "1"
    weights = {"AdditionalVersionWeights": {"2": 0.5}}
    done = aws.update_alias(FunctionName="aliased", Name="live", RoutingConfig=weights, RevisionId=made["RevisionId"])
    assert done["RoutingConfig"] == weights
    assert {call(aws, "aliased:live", 0)["ExecutedVersion"] for _ in range(64)} == {"1", "2"}
    with pytest.raises(aws.exceptions.PreconditionFailedException):
        aws.update_alias(FunctionName="aliased", Name="live", FunctionVersion="2", RevisionId=made["RevisionId"])
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        aws.update_alias(FunctionName="aliased", Name="live", RoutingConfig={"AdditionalVersionWeights": {"1": 0.5}})
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        aws.create_alias(FunctionName="aliased", Name="12", FunctionVersion="1")
    with pytest.raises(aws.exceptions.ResourceConflictException):
        aws.create_alias(FunctionName="aliased", Name="live", FunctionVersion="1")
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.create_alias(FunctionName="aliased", Name="gone", FunctionVersion="9")
    with pytest.raises(aws.exceptions.ResourceConflictException):
        aws.delete_function(FunctionName="aliased", Qualifier="2")
    assert [item["Name"] for item in aws.list_aliases(FunctionName="aliased")["Aliases"]] == ["live"]
    assert aws.list_aliases(FunctionName="aliased", FunctionVersion="2")["Aliases"]
    aws.update_alias(FunctionName="aliased", Name="live", RoutingConfig={}, FunctionVersion="2")
    assert "RoutingConfig" not in aws.get_alias(FunctionName="aliased", Name="live")
    aws.delete_alias(FunctionName="aliased", Name="live")
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_alias(FunctionName="aliased", Name="live")


def test_concurrency_is_reserved_and_kept_warm(aws: Any) -> None:
    make(aws, "crowded", Publish=True)
    assert "ReservedConcurrentExecutions" not in aws.get_function_concurrency(FunctionName="crowded")
    aws.put_function_concurrency(FunctionName="crowded", ReservedConcurrentExecutions=2)
    assert aws.get_function_concurrency(FunctionName="crowded")["ReservedConcurrentExecutions"] == 2
    assert aws.get_function(FunctionName="crowded")["Concurrency"] == {"ReservedConcurrentExecutions": 2}
    limit = aws.get_account_settings()["AccountLimit"]
    assert limit["UnreservedConcurrentExecutions"] == limit["ConcurrentExecutions"] - 2
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        aws.put_function_concurrency(FunctionName="crowded", ReservedConcurrentExecutions=limit["ConcurrentExecutions"])
    asked = {"FunctionName": "crowded", "Qualifier": "1"}
    with pytest.raises(aws.exceptions.ProvisionedConcurrencyConfigNotFoundException):
        aws.get_provisioned_concurrency_config(**asked)
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        aws.put_provisioned_concurrency_config(**asked, ProvisionedConcurrentExecutions=3)
    done = aws.put_provisioned_concurrency_config(**asked, ProvisionedConcurrentExecutions=1)
    assert done["RequestedProvisionedConcurrentExecutions"] == 1
    assert aws.get_provisioned_concurrency_config(**asked)["Status"] == "READY"
    assert len(aws.list_provisioned_concurrency_configs(FunctionName="crowded")["ProvisionedConcurrencyConfigs"]) == 1
    aws.delete_provisioned_concurrency_config(**asked)
    aws.put_function_concurrency(FunctionName="crowded", ReservedConcurrentExecutions=0)
    with pytest.raises(aws.exceptions.TooManyRequestsException) as refused:
        call(aws, "crowded", 1)
    assert refused.value.response["Reason"] == "ReservedFunctionConcurrentInvocationLimitExceeded"
    assert refused.value.response["ResponseMetadata"]["HTTPHeaders"]["retry-after"]
    aws.delete_function_concurrency(FunctionName="crowded")
    assert call(aws, "crowded", {})["StatusCode"] == 200


def test_what_becomes_of_events_is_set(aws: Any) -> None:
    make(aws, "evented", Publish=True)
    queue = "arn:aws:sqs:eu-central-1:123456789012:dead"
    put = aws.put_function_event_invoke_config(
        FunctionName="evented", MaximumRetryAttempts=1, DestinationConfig={"OnFailure": {"Destination": queue}}
    )
    assert (put["MaximumRetryAttempts"], put["FunctionArn"].endswith(":$LATEST")) == (1, True)
    done = aws.update_function_event_invoke_config(FunctionName="evented", MaximumEventAgeInSeconds=60)
    assert (done["MaximumRetryAttempts"], done["MaximumEventAgeInSeconds"]) == (1, 60)
    aws.put_function_event_invoke_config(FunctionName="evented", Qualifier="1", MaximumRetryAttempts=0)
    listed = aws.list_function_event_invoke_configs(FunctionName="evented")["FunctionEventInvokeConfigs"]
    assert len(listed) == 2
    aws.delete_function_event_invoke_config(FunctionName="evented", Qualifier="1")
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_function_event_invoke_config(FunctionName="evented", Qualifier="1")


def test_topics_call_a_function_by_mappings(aws: Any) -> None:
    make(aws, "mapped")
    asked = {"EventSourceArn": SOURCE_ARN, "FunctionName": "mapped"}
    made = aws.create_event_source_mapping(
        **asked,
        BatchSize=10,
        MaximumBatchingWindowInSeconds=2,
        FunctionResponseTypes=["ReportBatchItemFailures"],
        FilterCriteria={"Filters": [{"Pattern": json.dumps({"message": {"percentage": [{"numeric": ["<", 0.2]}]}})}]},
        StartingPosition="LATEST",
    )
    with pytest.raises(aws.exceptions.ResourceConflictException):
        aws.create_event_source_mapping(**asked)
    found = aws.get_event_source_mapping(UUID=made["UUID"])
    assert (found["State"], found["BatchSize"], found["FunctionArn"]) == (
        "Enabled",
        10,
        "arn:aws:lambda:local:000000000000:function:mapped",
    )
    aws.update_event_source_mapping(UUID=made["UUID"], Enabled=False, BatchSize=20)
    assert aws.get_event_source_mapping(UUID=made["UUID"])["State"] == "Disabled"
    listed = aws.get_paginator("list_event_source_mappings").paginate(FunctionName="mapped").build_full_result()
    assert [item["UUID"] for item in listed["EventSourceMappings"]] == [made["UUID"]]
    aws.tag_resource(Resource=made["EventSourceMappingArn"], Tags={"a": "b"})
    assert aws.list_tags(Resource=made["EventSourceMappingArn"])["Tags"] == {"a": "b"}
    assert aws.delete_event_source_mapping(UUID=made["UUID"])["State"] == "Deleting"
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_event_source_mapping(UUID=made["UUID"])
    for members in (
        {"EventSourceArn": "arn:aws:sqs:eu-central-1:123456789012:queue"},
        {"FilterCriteria": {"Filters": [{"Pattern": "{no json"}]}},
        {"TumblingWindowInSeconds": 5},
        {"StartingPosition": "AT_TIMESTAMP"},
        {"BatchSize": 10_001},
    ):
        with pytest.raises(aws.exceptions.InvalidParameterValueException):
            aws.create_event_source_mapping(**{**asked, **members})


def test_layers_are_beside_the_code(aws: Any) -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("python/shared.py", "WORD = 'from the layer'\n")
    layer = {"LayerName": "shared", "Content": {"ZipFile": data.getvalue()}, "CompatibleRuntimes": ["python3.12"]}
    first = aws.publish_layer_version(**layer, Description="words")
    assert (first["Version"], first["Description"]) == (1, "words")
    arn = aws.publish_layer_version(**layer)["LayerVersionArn"]
    source = "import shared\n\ndef handler(event, context):\n    return shared.WORD\n"
    made = make(aws, "layered", source, Layers=[arn])
    assert made["Layers"] == [{"Arn": arn, "CodeSize": len(data.getvalue())}]
    assert call(aws, "layered", 0)["Payload"] == "from the layer"
    assert aws.get_layer_version_by_arn(Arn=arn)["Version"] == 2
    assert aws.get_layer_version(LayerName="shared", VersionNumber=1)["Content"]["CodeSize"] == len(data.getvalue())
    listed = aws.list_layer_versions(LayerName="shared", CompatibleRuntime="python3.12")["LayerVersions"]
    assert [item["Version"] for item in listed] == [2, 1]
    (newest,) = aws.list_layers()["Layers"]
    assert newest["LatestMatchingVersion"]["LayerVersionArn"] == arn
    aws.delete_layer_version(LayerName="shared", VersionNumber=2)
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_layer_version(LayerName="shared", VersionNumber=2)
    assert call(aws, "layered", 0)["Payload"] == "from the layer"  # who has it keeps it
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        make(aws, "late", source, Layers=[arn])
    assert aws.publish_layer_version(**layer)["Version"] == 3


def test_tags_and_policies_are_kept(aws: Any) -> None:
    arn = make(aws, "tagged", Tags={"team": "robots"})["FunctionArn"]
    aws.tag_resource(Resource=arn, Tags={"stage": "test"})
    aws.untag_resource(Resource=arn, TagKeys=["team", "none"])
    assert aws.list_tags(Resource=arn)["Tags"] == {"stage": "test"}
    assert aws.get_function(FunctionName="tagged")["Tags"] == {"stage": "test"}
    asked = {"FunctionName": "tagged", "StatementId": "one", "Action": "lambda:InvokeFunction"}
    said = aws.add_permission(
        **asked, Principal="events.amazonaws.com", SourceArn="arn:aws:events:eu-central-1:000000000000:rule/r"
    )
    assert json.loads(said["Statement"])["Principal"] == {"Service": "events.amazonaws.com"}
    with pytest.raises(aws.exceptions.ResourceConflictException):
        aws.add_permission(**asked, Principal="*")
    policy = aws.get_policy(FunctionName="tagged")
    assert [item["Sid"] for item in json.loads(policy["Policy"])["Statement"]] == ["one"]
    with pytest.raises(aws.exceptions.PreconditionFailedException):
        aws.remove_permission(FunctionName="tagged", StatementId="one", RevisionId="x")
    aws.remove_permission(FunctionName="tagged", StatementId="one", RevisionId=policy["RevisionId"])
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_policy(FunctionName="tagged")


def test_lists_come_in_pages(aws: Any) -> None:
    for number in range(5):
        make(aws, f"paged-{number}", HANDLER)
    pages = list(aws.get_paginator("list_functions").paginate(PaginationConfig={"PageSize": 2}))
    names = [item["FunctionName"] for page in pages for item in page["Functions"]]
    assert len(pages) > 2
    assert names == sorted(names)
    assert {f"paged-{number}" for number in range(5)} <= set(names)
    every = aws.get_paginator("list_functions").paginate(FunctionVersion="ALL").build_full_result()["Functions"]
    assert {item["Version"] for item in every} >= {"$LATEST"}
    with pytest.raises(aws.exceptions.InvalidParameterValueException):
        aws.list_functions(Marker="\x7f no marker")


def test_an_event_is_accepted_and_called_later(aws: Any) -> None:
    make(aws, "later")
    assert aws.invoke(FunctionName="later", InvocationType="Event", Payload=b'{"a": 1}')["StatusCode"] == 202
    assert aws.invoke_async(FunctionName="later", InvokeArgs=b"{}")["Status"] == 202
    with pytest.raises(aws.exceptions.InvalidRequestContentException):
        aws.invoke(FunctionName="later", Payload=b"no json")
    with pytest.raises(aws.exceptions.InvalidRequestContentException):
        aws.invoke(FunctionName="later", Payload=b"{" * 200_000)
    inside = aws.invoke(FunctionName="later", Payload=b"{" + b"," * 200_000 + b"}")  # the function's runtime reads it
    assert (inside["StatusCode"], inside["FunctionError"]) == (200, "Unhandled")
    with pytest.raises(aws.exceptions.RequestTooLargeException):
        aws.invoke(FunctionName="later", InvocationType="Event", Payload=b'"' + b"x" * (1 << 20) + b'"')
    with pytest.raises(aws.exceptions.RequestTooLargeException):
        aws.invoke(FunctionName="later", Payload=b'"' + b"x" * (6 << 20) + b'"')
    with pytest.raises(aws.exceptions.InvalidParameterValueException, match="TenantId"):
        aws.invoke(FunctionName="later", TenantId="t")
    context = base64.b64encode(json.dumps({"custom": {"a": "b"}}).encode()).decode()
    source = "def handler(event, context):\n    return context.client_context.custom\n"
    make(aws, "contextual", source)
    assert call(aws, "contextual", 0, ClientContext=context)["Payload"] == {"a": "b"}
    with pytest.raises(aws.exceptions.InvalidRequestContentException):
        aws.invoke(FunctionName="contextual", ClientContext="no base64")


def test_an_answer_comes_piece_by_piece(aws: Any) -> None:
    source = "def handler(event, context):\n    for number in range(3):\n        yield f'{number} '.encode()\n"
    make(aws, "streamed", source, Environment={"Variables": {"METAROS_RUNTIME_CLIENT": "metaros"}})
    answer = aws.invoke_with_response_stream(FunctionName="streamed", Payload=b"{}", LogType="Tail")
    events = list(answer["EventStream"])
    pieces = [event["PayloadChunk"]["Payload"] for event in events if "PayloadChunk" in event]
    assert b"".join(pieces) == b"0 1 2 "
    assert "InvokeComplete" in events[-1]
    assert "ErrorCode" not in events[-1]["InvokeComplete"]
    assert answer["ExecutedVersion"] == "$LATEST"
    make(aws, "broken-stream", "def handler(event, context):\n    raise KeyError('x')\n")
    events = list(aws.invoke_with_response_stream(FunctionName="broken-stream")["EventStream"])
    assert events[-1]["InvokeComplete"]["ErrorCode"]


def test_who_may_not_change_does_not_see_variables(aws: Any, served: LambdaGateway) -> None:
    make(aws, "secretive", Environment={"Variables": {"PASSWORD": "hunter2"}})
    viewer = served.client(served.key("viewer"))
    shown = viewer.get_function(FunctionName="secretive")["Configuration"]["Environment"]
    assert shown["Error"]["ErrorCode"] == "AccessDeniedException"
    listed = viewer.list_functions()["Functions"]
    assert all("hunter2" not in json.dumps(item, default=str) for item in listed)
    for refused in (lambda: call(viewer, "secretive", 0), lambda: viewer.delete_function(FunctionName="secretive")):
        with pytest.raises(ClientError) as error:
            refused()
        assert error.value.response["Error"]["Code"] == "AccessDeniedException"
    operator = served.client(served.key("operator"))
    assert call(operator, "secretive", {})["StatusCode"] == 200
    with pytest.raises(ClientError, match="AccessDenied"):
        operator.publish_version(FunctionName="secretive")


def test_a_large_zip_goes_by_way_of_a_file(aws: Any) -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("app.py", HANDLER)
        archive.writestr("weights.bin", bytes(8 << 20))
    made = make(aws, "large", Code={"ZipFile": data.getvalue()})
    assert made["CodeSize"] == len(data.getvalue())
    assert call(aws, "large", {"ok": 1})["Payload"] == {"ok": 1}


def test_create_needs_what_botocore_says(aws: Any) -> None:
    with pytest.raises(aws.exceptions.InvalidParameterValueException, match="Role"):
        aws.create_function(FunctionName="x", Role="nobody", Code={"ZipFile": zipped()}, Runtime="python3.12")
    with pytest.raises(aws.exceptions.InvalidParameterValueException, match="Handler"):
        aws.create_function(FunctionName="x", Role=ROLE, Code={"ZipFile": zipped()}, Runtime="python3.12")
    with pytest.raises(aws.exceptions.InvalidParameterValueException, match="FunctionName"):
        make(aws, "x" * 65)
