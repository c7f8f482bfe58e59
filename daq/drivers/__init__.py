"""Sources of sample blocks: the real card, the simulated rig and the replay of a recording."""
