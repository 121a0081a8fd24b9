"""Says what it was told, and who said it."""


def handler(event: dict, context) -> dict:
    """`event` is JSON, in EventBridge's shape if a rule calls; `context` is AWS Lambda's own."""
    kind = event.get("detail-type", "a call by hand")
    robot = event.get("detail", {}).get("robot", "nobody")
    print(f"{kind} about {robot}, {context.get_remaining_time_in_millis()} ms are left")
    return {"seen": kind, "robot": robot}
