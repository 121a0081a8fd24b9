"""`metaros.automation.robot` by the name that is typed, and that signed bundles and launch tables have: it stays."""
