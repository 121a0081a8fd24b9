"""Routes of users, keys, sign-in, robots' identities and the audit log."""
