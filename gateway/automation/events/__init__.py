"""The journal of what happens in the fleet: kept, read with a cursor, and watched."""
