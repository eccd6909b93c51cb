"""Rendered cameras. Only the modules `renderer` and `child` load OpenGL, and only when they are used."""


class RenderError(RuntimeError):
    """Pictures cannot be made; the message says why and what would help, in one line."""
