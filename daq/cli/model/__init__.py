"""`rig model` and `rig predict`: studies of the rotor and its films, sweeps, thesis report, prediction."""
