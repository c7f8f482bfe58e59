"""rig.toml: its schema, and the validated rig that it describes."""
