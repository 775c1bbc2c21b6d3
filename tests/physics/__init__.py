"""The laws of the physics, file by file as the package has them."""
