"""Drawing with OpenGL 3.3: contexts, programs, buffers and the renderer. Only this package imports OpenGL."""
