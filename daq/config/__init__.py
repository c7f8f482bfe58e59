"""The configuration files: schema, checks and loading of rig.toml, calibration, rotor and import mapping files."""
