"""What a worker of a user's function may do: four levels, from a whole room of its own (L3) to a plain process (L0)."""
