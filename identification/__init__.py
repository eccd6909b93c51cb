"""What the simulation gets wrong on measured flights, why, and a better model."""
