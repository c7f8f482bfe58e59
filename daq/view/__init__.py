"""The live picture, drawn with rerun."""
