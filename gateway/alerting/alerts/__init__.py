"""Alerts: findings grouped by robot and cause, from the first finding until they are resolved."""
