"""Sources of sample blocks: the NI card, the simulated rig and the replay of a recording."""
