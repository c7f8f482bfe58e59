"""Studies of the rotor and its films: a table and pictures from parameters, without a disk or a clock."""
