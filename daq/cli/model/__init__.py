"""The commands `rig model`: studies of the rotor and its films, sweeps, the thesis computed again."""
