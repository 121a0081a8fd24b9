"""What a call of a function costs: our engine and gateway beside AWS's own runtime interface emulator."""
