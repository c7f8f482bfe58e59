"""Studies of the rotor and its films: a table and plots from parameters."""
