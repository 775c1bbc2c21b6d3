"""Course files: reading and writing TOML and .glb files, and reading the mesh files that they name."""
