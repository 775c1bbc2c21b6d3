"""The exception of the rendering package."""


class RenderingError(RuntimeError):
    """Images cannot be rendered on this machine; the message names what was tried, why it failed, and the remedy."""
