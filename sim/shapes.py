"""The vehicle's visible shapes as triangle meshes, for whoever draws it elsewhere."""

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Triangles = NDArray[np.int64]
Mesh = tuple[Floats, Triangles, tuple[float, float, float, float]]  # vertices [m], faces, RGBA

_SIDES = 12  # of round things


def vehicle_meshes(model: mujoco.MjModel) -> dict[str, Mesh]:
    """By colour, all of the body "vehicle" and its children at rest: vertices (V, 3) [m] in the vehicle's body axes."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    root = model.body("vehicle").id
    turn, origin = data.xmat[root].reshape(3, 3), data.xpos[root]
    parts: dict[tuple[float, ...], list[tuple[Floats, Triangles]]] = {}
    for geom in range(model.ngeom):
        body = model.geom_bodyid[geom]
        if model.body_rootid[body] != root:
            continue
        vertices, faces = _shape(model, geom)
        placed = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        material = model.geom_matid[geom]
        colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        parts.setdefault(tuple(float(c) for c in colour), []).append(((placed - origin) @ turn, faces))
    return {f"part_{k}": _joined(shapes, colour) for k, (colour, shapes) in enumerate(parts.items())}


def _joined(shapes: list[tuple[Floats, Triangles]], colour: tuple[float, ...]) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    faces = np.vstack([triangles + start for (_, triangles), start in zip(shapes, starts, strict=False)])
    red, green, blue, alpha = colour
    return np.vstack([vertices for vertices, _ in shapes]), faces, (red, green, blue, alpha)


def _shape(model: mujoco.MjModel, geom: int) -> tuple[Floats, Triangles]:
    """Vertices (V, 3) and faces (F, 3) of a geom in its own axes."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    match kind:
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
            vertices = model.mesh_vert[first : first + count].astype(float)
            return vertices, model.mesh_face[face : face + faces].astype(int)
        case mujoco.mjtGeom.mjGEOM_BOX:
            return _prism(np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * size[:2], size[2])
        case mujoco.mjtGeom.mjGEOM_CYLINDER | mujoco.mjtGeom.mjGEOM_CAPSULE:
            angle = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
            # a capsule is drawn as the cylinder that it nearly is: its ends lie within its neighbours
            return _prism(size[0] * np.stack([np.cos(angle), np.sin(angle)], axis=1), size[1])
    raise ValueError(f"geom {model.geom(geom).name!r}: no mesh is made of shapes of type {kind}")


def _prism(outline: Floats, half: float) -> tuple[Floats, Triangles]:
    """A prism over a convex outline (N, 2), counter-clockwise, from z = -half to +half."""
    n = len(outline)
    here, onward = np.arange(n), np.roll(np.arange(n), -1)
    bottom = np.column_stack([outline, np.full(n, -half)])
    top = np.column_stack([outline, np.full(n, half)])
    sides = np.vstack([np.column_stack([here, onward, onward + n]), np.column_stack([here, onward + n, here + n])])
    fan = np.column_stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)])
    return np.vstack([bottom, top]), np.vstack([sides, fan[:, ::-1], fan + n])
