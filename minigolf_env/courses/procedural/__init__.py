"""Endless levels: a hole for every number, the same on every machine."""

from minigolf_env.courses.procedural.build import DIFFICULTIES, GENERATOR, build_level

__all__ = ["DIFFICULTIES", "GENERATOR", "build_level"]
