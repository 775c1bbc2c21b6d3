"""Geometry of courses: closed triangle meshes from the description of a course file. Reads no files."""
