"""The world: vehicle, air, sensors and cameras. It does not know who flies it; importing it loads no OpenGL."""
