"""Tests of the physics; files mirror the modules of the package."""
