"""Draws one small picture through EGL and says who drew it.

A script for a process of its own, because a broken driver ends its process. Prints JSON: renderer, opengl, seconds.
"""

import json
import os
import time

SCENE = """
<mujoco>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="box" size="1 1 0.1" rgba="1 0 0 1"/>
    <camera name="above" pos="0 0 2"/>
  </worldbody>
</mujoco>
"""


def main() -> None:
    """Draw a red square that fills the picture."""
    os.environ["MUJOCO_GL"] = "egl"  # read when mujoco is imported
    import mujoco
    from OpenGL import GL

    start = time.perf_counter()
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 64, 64) as renderer:
        renderer.update_scene(data, "above")
        picture = renderer.render()
        who, what = GL.glGetString(GL.GL_RENDERER), GL.glGetString(GL.GL_VERSION)
    red, green, blue = (float(v) for v in picture[24:40, 24:40].reshape(-1, 3).mean(0))
    if not (red > 60 and red > 3 * max(green, blue)):
        raise SystemExit(f"a red square came out as colour ({red:.0f}, {green:.0f}, {blue:.0f})")
    print(json.dumps({"renderer": who.decode(), "opengl": what.decode(), "seconds": time.perf_counter() - start}))


if __name__ == "__main__":
    main()
