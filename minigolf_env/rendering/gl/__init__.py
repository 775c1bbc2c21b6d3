"""Rendering with OpenGL 3.3: contexts, shader programs, buffers and renderers."""
