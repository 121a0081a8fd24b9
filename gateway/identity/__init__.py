"""Who may do what: principals and their credentials, the permission table, robots' identities, the audit log."""
