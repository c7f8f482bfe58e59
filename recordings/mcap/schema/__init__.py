"""Protocol buffer messages of a recording; generated code."""
