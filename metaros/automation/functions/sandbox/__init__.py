"""What a worker of a user's function may do: four levels, from full isolation (L3) to a plain process (L0)."""
