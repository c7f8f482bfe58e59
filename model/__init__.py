"""Rotor on floating-ring bearings: finite elements, oil films, motion in time, prediction over speed."""
