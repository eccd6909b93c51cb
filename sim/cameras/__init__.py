"""Rendered cameras. Only the modules `renderer` and `child` load OpenGL, and only when they are used."""
