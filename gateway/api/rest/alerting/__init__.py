"""Routes of alerts, checks and what is watched."""
