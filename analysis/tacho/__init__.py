"""From the tacho waveform or counter to pulses and shaft angle."""
