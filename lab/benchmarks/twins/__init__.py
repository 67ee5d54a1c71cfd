"""Twins of plain scenes: the same scene compressed in every way that is read, drawn beside the plain one."""
