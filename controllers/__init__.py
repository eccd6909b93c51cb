"""State in, controls out: loops, gain design from matrices handed in, the landing sequence."""
