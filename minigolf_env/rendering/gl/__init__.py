"""Rendering with OpenGL 3.3: contexts, shader programs, buffers and renderers.

It is written with PyOpenGL's functions and no scene library, since one renderer must draw the same bits in an EGL
context, in pyglet's window and in a dirty rectangle, and leave the contexts of other libraries as they were.
"""
