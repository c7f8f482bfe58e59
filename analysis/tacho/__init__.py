"""From the tacho's waveform or counter to the angle of the shaft."""
