"""Order, frequency and full spectra, order maps, waterfalls and cascades."""
