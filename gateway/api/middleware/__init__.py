"""What every request passes before its route: ASGI applications around each other."""
