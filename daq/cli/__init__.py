"""The command `rig`."""
