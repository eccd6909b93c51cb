"""Shapes of the Raptor-90's body, written as OBJ files beside this script: `python raptor90_meshes.py`.

Body axes, metres: x forward, y left, z up, origin at the centre of mass.
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# the canopy's stations from nose to boom: x, half width, top, bottom
CANOPY = np.array([
    (0.400, 0.004, -0.036, -0.046), (0.394, 0.021, -0.014, -0.064), (0.375, 0.038, 0.008, -0.084),
    (0.335, 0.057, 0.040, -0.107), (0.270, 0.074, 0.082, -0.124), (0.180, 0.084, 0.124, -0.131),
    (0.090, 0.085, 0.140, -0.127), (0.000, 0.078, 0.130, -0.108), (-0.090, 0.064, 0.106, -0.072),
    (-0.170, 0.047, 0.084, -0.032), (-0.230, 0.033, 0.070, 0.005), (-0.280, 0.024, 0.064, 0.018),
])  # fmt: skip
SQUARENESS = 2.4  # exponent of the superellipse that its cross-sections are
BOOM = np.array([(-0.24, 0.020, 0.042), (-0.915, 0.013, 0.078)])  # x, radius, height


def canopy_point(x: ArrayLike, angle: ArrayLike, proud: float = 0.0) -> Floats:
    """Points (..., 3) on the canopy at station `x`, `angle` [rad] from the left side upward, `proud` [m] of it."""
    x, angle = np.broadcast_arrays(np.asarray(x, float), np.asarray(angle, float))
    width, top, bottom = PchipInterpolator(CANOPY[::-1, 0], CANOPY[::-1, 1:])(x).T.reshape(3, *x.T.shape)
    width, top, bottom = (v.T for v in (width, top, bottom))
    c, s = np.cos(angle), np.sin(angle)
    y = (width + proud) * np.sign(c) * np.abs(c) ** (2 / SQUARENESS)
    z = (top + bottom) / 2 + ((top - bottom) / 2 + proud) * np.sign(s) * np.abs(s) ** (2 / SQUARENESS)
    return np.stack([x, y, z], axis=-1)


def grid_faces(rows: int, columns: int, closed: bool) -> Ints:
    """Triangles (M, 3) of a grid of vertices; `closed` joins its last column to the first."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3)


def capped(rings: Floats) -> tuple[Floats, Ints]:
    """Closed surface through `rings` (rows, columns, 3) with a fan at either end."""
    rows, columns, _ = rings.shape
    vertices = np.vstack([rings.reshape(-1, 3), rings[0].mean(0), rings[-1].mean(0)])
    j = np.arange(columns)
    k, last, n = (j + 1) % columns, (rows - 1) * columns, rows * columns
    first_cap = np.stack([np.full(columns, n), j, k], axis=-1)
    last_cap = np.stack([np.full(columns, n + 1), last + k, last + j], axis=-1)
    return vertices, np.vstack([grid_faces(rows, columns, closed=True), first_cap, last_cap])


def canopy() -> tuple[Floats, Ints]:
    """The body shell."""
    x = 0.40 - 0.68 * np.linspace(0.0, 1.0, 26) ** 1.35
    angle = np.linspace(0.0, 2 * np.pi, 28, endpoint=False)
    return capped(canopy_point(x[:, None], angle[None, :]))


def patch(x: Floats, low: Floats, high: Floats, proud: float, columns: int = 13) -> tuple[Floats, Ints]:
    """A sheet lying `proud` [m] on the canopy between the angles `low` and `high` at each station `x`."""
    share = np.linspace(0.0, 1.0, columns)
    outer = canopy_point(x[:, None], low[:, None] + (high - low)[:, None] * share, proud)
    faces = grid_faces(len(x), columns, closed=False)
    # a back of its own, so that it encloses a volume as the MJCF compiler wants
    inner = canopy_point(x[:, None], low[:, None] + (high - low)[:, None] * share, proud - 0.004)
    count = outer.shape[0] * columns
    return np.vstack([outer.reshape(-1, 3), inner.reshape(-1, 3)]), np.vstack([faces, faces[:, ::-1] + count])


def window() -> tuple[Floats, Ints]:
    """The tinted cockpit window: over the top, from the nose to below the mast."""
    x = np.linspace(0.352, 0.13, 12)
    share = (x - x[-1]) / (x[0] - x[-1])
    half = np.radians(78.0) * np.sqrt(np.clip(1.0 - np.abs(2.0 * share - 0.85) ** 2.6 / 1.55, 0.02, 1.0))
    return patch(x, np.pi / 2 - half, np.pi / 2 + half, proud=0.0025)


def stripe(side: int) -> tuple[Floats, Ints]:
    """The sweeping stripe on the left (+1) or right (-1)."""
    x = np.linspace(0.345, -0.26, 22)
    middle = np.radians(np.interp(x, [-0.26, 0.0, 0.345], [28.0, -22.0, -30.0]))
    half = np.radians(np.interp(x, [-0.26, 0.05, 0.345], [16.0, 15.0, 2.0]))
    low, high = middle - half, middle + half
    if side < 0:
        low, high = np.pi - high, np.pi - low
    return patch(x, low, high, proud=0.002, columns=4)


def boom() -> tuple[Floats, Ints]:
    """The tapered tail boom."""
    angle = np.linspace(0.0, 2 * np.pi, 14, endpoint=False)
    rings = [np.stack([np.full_like(angle, x), r * np.cos(angle), z + r * np.sin(angle)], -1) for x, r, z in BOOM]
    return capped(np.array(rings))


def plate(outline: ArrayLike, thickness: float, normal: int, offset: float = 0.0) -> tuple[Floats, Ints]:
    """A convex flat plate: `outline` (N, 2) [m] in the two axes other than `normal`, counter-clockwise along it."""
    outline = np.asarray(outline, float)
    count = len(outline)
    rings = np.stack([np.insert(outline, normal, offset + s * thickness / 2, axis=1) for s in (1.0, -1.0)])
    j = np.arange(1, count - 1)
    fan = np.stack([np.zeros_like(j), j, j + 1], axis=-1)
    k = np.arange(count)
    rim = np.stack([k, k + count, (k + 1) % count, (k + 1) % count, k + count, (k + 1) % count + count], -1)
    faces = np.vstack([fan, fan[:, ::-1] + count, rim.reshape(-1, 3)])
    return rings.reshape(-1, 3), faces


def blade(root: float, tip: float, chord: float, thickness: float) -> tuple[Floats, Ints]:
    """A rotor blade along x with a rounded nose towards -y (a rotor that turns clockwise seen from above)."""
    section = np.array([(-0.30, 0.0), (-0.24, 0.42), (-0.05, 0.5), (0.70, 0.0), (-0.05, -0.5), (-0.24, -0.42)])
    rings = [
        np.column_stack([np.full(len(section), x), c * chord * section[:, 0], thickness * section[:, 1]])
        for x, c in ((root, 0.55), (root + 0.06, 1.0), (tip - 0.012, 1.0), (tip, 0.8))
    ]
    return capped(np.array(rings))


def disc(radius: float, count: int = 48) -> tuple[Floats, Ints]:
    """A thin disc in the x-y plane."""
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return plate(radius * np.column_stack([np.cos(angle), np.sin(angle)]), 0.002, normal=2)


def outward(vertices: Floats, faces: Ints) -> Ints:
    """The faces turned so that the enclosed volume is positive."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return faces if np.einsum("ij,ij->", a, np.cross(b, c)) > 0 else faces[:, ::-1]


def normals(vertices: Floats, faces: Ints, crease_deg: float = 50.0) -> tuple[Floats, Ints]:
    """Normals (K, 3) and their index for each corner of each face; edges sharper than the crease stay sharp."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    unit = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-15)
    around: list[list[int]] = [[] for _ in vertices]
    for f, face in enumerate(faces):
        for v in face:
            around[v].append(f)
    corner = np.empty((len(faces), 3, 3))
    for f, face in enumerate(faces):
        for k, v in enumerate(face):
            near = [g for g in around[v] if unit[g] @ unit[f] > np.cos(np.radians(crease_deg))] or [f]
            corner[f, k] = area[near].sum(0)
    corner /= np.maximum(np.linalg.norm(corner, axis=2, keepdims=True), 1e-15)
    distinct, index = np.unique(np.round(corner.reshape(-1, 3), 3), axis=0, return_inverse=True)
    return distinct, index.reshape(-1, 3)


def write(file: Path, vertices: Floats, faces: Ints) -> None:
    """One mesh as OBJ with normals."""
    used, index = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], index.reshape(-1, 3)
    keep = np.linalg.norm(np.cross(*(vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2))), axis=1) > 1e-10
    faces = outward(vertices, faces[keep])
    directions, corners = normals(vertices, faces)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in vertices]
    lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in directions]
    for face, corner in zip(faces + 1, corners + 1, strict=True):
        lines.append("f " + " ".join(f"{v}//{n}" for v, n in zip(face, corner, strict=True)))
    file.write_text("\n".join(lines) + "\n")


FIN = [(-0.955, 0.235), (-0.905, 0.230), (-0.845, 0.085), (-0.870, 0.030), (-0.925, -0.075), (-0.950, -0.070)]
STABILISER = [(-0.665, -0.17), (-0.610, -0.165), (-0.575, 0.0), (-0.610, 0.165), (-0.665, 0.17)]
SHAPES = {
    "canopy": canopy,
    "window": window,
    "stripe_left": lambda: stripe(1),
    "stripe_right": lambda: stripe(-1),
    "boom": boom,
    "fin": lambda: plate(FIN, 0.004, normal=1, offset=0.018),
    "stabiliser": lambda: plate(STABILISER, 0.004, normal=2, offset=0.063),
    "blade": lambda: blade(0.10, 0.73, 0.060, 0.009),
    "tail_blade": lambda: blade(0.018, 0.125, 0.027, 0.004),
    "disc": lambda: disc(1.0),
}

if __name__ == "__main__":
    folder = Path(__file__).parent / "raptor90"
    folder.mkdir(exist_ok=True)
    for name, shape in SHAPES.items():
        write(folder / f"{name}.obj", *shape())
