"""What goes wrong when pictures cannot be drawn."""


class RenderingError(RuntimeError):
    """Pictures cannot be drawn here; the message says what was tried, why it failed, and the remedy."""
