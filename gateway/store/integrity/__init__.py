"""The check of a store: does it hold what its ledger says, and can all of it be read."""
