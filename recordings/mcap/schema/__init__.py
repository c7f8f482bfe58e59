"""Protocol buffer messages of a run file; generated code."""
