"""The exceptions of the rendering package."""


class RenderingError(RuntimeError):
    """Images cannot be rendered on this machine; the message names what was tried, why it failed, and the remedy."""


class ContextLostError(RenderingError):
    """The OpenGL context has ended: SDL (pygame), for one, ends the EGL display that a process's libraries share."""
