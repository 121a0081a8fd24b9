"""Pictures of a robot's camera go to a bucket of S3, or of whatever speaks its language.

Rules tell of a picture and do not carry it: the function fetches it from the gateway, as it was published, and puts
its JPEG into the bucket.
"""

import base64
import json
import os
import struct
import urllib.parse
import urllib.request
from datetime import UTC, datetime, timedelta

import boto3

S3 = boto3.client(
    "s3",
    endpoint_url=os.environ.get("S3_ENDPOINT") or None,
    region_name=os.environ.get("S3_REGION", "us-east-1"),
    aws_access_key_id=os.environ["S3_KEY_ID"],
    aws_secret_access_key=os.environ["S3_SECRET"],
)
SECOND_NS = 1_000_000_000


def handler(event: dict, context) -> dict:
    """`event` is of a topic's rule. The same picture twice is the same object, so a second delivery does no harm."""
    detail = event["detail"]
    found = fetch(detail["robot"], detail["topic"], detail["stamp_ns"], detail["seq"])
    form, picture = compressed_image(base64.b64decode(found["cdr"]))
    kind = "png" if "png" in form else "jpeg"
    key = f"{detail['robot']}{detail['topic']}/{detail['stamp_ns']}.{kind}"
    S3.put_object(Bucket=os.environ["S3_BUCKET"], Key=key, Body=picture, ContentType=f"image/{kind}")
    print(f"{key}: {len(picture)} bytes")
    return {"key": key, "size_bytes": len(picture)}


def fetch(robot: str, topic: str, stamp_ns: int, seq: int) -> dict:
    """The message with that number, as it was published."""
    at = datetime.fromtimestamp(stamp_ns // SECOND_NS, UTC)
    span = {"start": at.isoformat(), "end": (at + timedelta(seconds=1)).isoformat()}
    query = urllib.parse.urlencode({"topic": topic, "format": "cdr", "limit": 1000, **span})
    url = f"{os.environ['GATEWAY_URL']}/api/v1/robots/{robot}/messages?{query}"
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {os.environ['GATEWAY_KEY']}"})
    with urllib.request.urlopen(request, timeout=10) as answer:
        messages = json.load(answer)["messages"]
    return next(message for message in messages if message["seq"] == seq)


def compressed_image(cdr: bytes) -> tuple[str, bytes]:
    """Format and picture of a sensor_msgs/msg/CompressedImage: after the stamp come two texts, then the bytes."""
    order, place, parts = "<" if cdr[1] & 1 else ">", 12, []
    for _ in range(3):
        place += -place % 4
        (size,) = struct.unpack_from(f"{order}I", cdr, place)
        parts.append(cdr[place + 4 : place + 4 + size])
        place += 4 + size
    return parts[1].rstrip(b"\0").decode(), parts[2]
