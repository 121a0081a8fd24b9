"""Operations on robots: commands, publishing, service calls, driving, twins, nodes, updates."""
