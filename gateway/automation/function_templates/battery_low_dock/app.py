"""A robot whose battery runs low is sent to its dock, unless there is a reason to wait."""

MUST = 0.10  # below this it goes, whatever it does


def handler(event: dict, context) -> dict:
    """`event` is of a metric's rule. What is returned goes to the bus, where `battery_low_dock_go` hears it."""
    detail = event["detail"]
    robot, charge = detail["robot"], detail["value"]
    dock = charge < MUST or not busy(robot)
    print(f"{robot} is at {charge:.0%}: {'to the dock' if dock else 'it goes on'}")
    return {"dock": dock, "robot": robot, "charge": charge}


def busy(robot: str) -> bool:
    """Here is the place for what you know of your robots; this one knows of none that must not be disturbed."""
    return False
