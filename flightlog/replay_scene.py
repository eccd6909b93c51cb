"""What stands still in the replay's 3D scene: ground, pad with its mark, the vehicle's meshes and its cameras."""

from collections.abc import Mapping
from itertools import pairwise

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy import sparse

from flightlog.equipment import CameraSpec
from flightlog.marks import Disc, Mark
from flightlog.replay_layout import NIGHT

Floats = NDArray[np.float64]
Mesh = tuple[NDArray[np.floating], NDArray[np.integer], tuple[float, float, float, float]]
"""Vertices (V, 3) [m] in body axes, triangles (F, 3), colour RGBA [0..1]."""

GRASS = np.array([58, 84, 52])
CREASE = 35.0  # [deg] edges sharper than this stay sharp
_EXTENT = 30.0  # [m] half the side of the ground
_TEXELS = 1024
_COAT = 5e-4  # [m] from one coat of paint to the next
_TONES = {"white": (245, 245, 245), "grey": (170, 172, 170), "black": (62, 66, 72)}


def log_scene(rec: rr.RecordingStream, meshes: Mapping[str, Mesh], mark: Mark | None) -> None:
    """Log ground, mark and vehicle as static."""
    rec.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _ground(rec)
    if mark is not None:
        _pad(rec, mark)
    log_vehicle(rec, meshes)


def log_vehicle(
    rec: rr.RecordingStream,
    meshes: Mapping[str, Mesh],
    place: str = "world/vehicle",
    tint: tuple[float, float, float] | None = None,
) -> None:
    """Log a vehicle's meshes as static, axes where there are none; tint: a colour [0..1] that all its parts take."""
    for name, (vertices, faces, rgba) in meshes.items():
        corners, normals = shaded(np.asarray(vertices, float), np.asarray(faces))
        colour = rgba if tint is None else (*(0.2 * np.array(rgba[:3]) + 0.8 * np.array(tint)), rgba[3])
        rec.log(
            f"{place}/{name}",
            rr.Mesh3D(
                vertex_positions=corners,
                triangle_indices=np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
                vertex_normals=normals,
                albedo_factor=np.round(np.clip(colour, 0.0, 1.0) * np.float64(255.0)).astype(np.uint8),
            ),
            static=True,
        )
    if not meshes:
        axes = np.eye(3) * 0.6
        rec.log(
            f"{place}/axes",
            rr.Arrows3D(vectors=axes, colors=[(255, 90, 90), (110, 220, 110), (110, 150, 255)], radii=0.02),
            static=True,
        )


def log_cameras(rec: rr.RecordingStream, cameras: Mapping[str, CameraSpec]) -> None:
    """Log where the cameras sit and what they span as static."""
    for name, spec in cameras.items():
        place = f"world/vehicle/cameras/{name}"
        model = spec.model
        rec.log(place, rr.Transform3D(translation=spec.mount.position, mat3x3=spec.mount.axes), static=True)
        rec.log(
            place,
            rr.Pinhole(
                focal_length=(model.fx, model.fy),
                # rerun counts from the picture's corner, pixel centres at halves
                principal_point=(model.cx + 0.5, model.cy + 0.5),
                width=model.width,
                height=model.height,
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.2,
                color=(110, 150, 180, 160),
                line_width=-1.0,  # below zero: in points of the display, not in metres
            ),
            static=True,
        )


def shaded(vertices: Floats, faces: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """Corners (3F, 3) of all triangles and their normals (3F, 3), smooth except over creases."""
    corners = vertices[faces.reshape(-1)]
    edges = corners.reshape(-1, 3, 3)
    areas = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    length = np.linalg.norm(areas, axis=1, keepdims=True)
    normals = areas / np.maximum(length, 1e-12)
    # vertices at one place are one, or a seam would show
    _, place = np.unique(np.round(corners, 6), axis=0, return_inverse=True)
    face = np.repeat(np.arange(len(faces)), 3)
    touches = sparse.csr_array((np.ones(len(face)), (place.reshape(-1), face)))
    pairs = sparse.csr_array((np.ones(len(face)), (np.arange(len(face)), place.reshape(-1)))) @ touches
    corner, other = pairs.nonzero()
    smooth = np.einsum("ij,ij->i", normals[face[corner]], normals[other]) > np.cos(np.radians(CREASE))
    total = np.zeros_like(corners)
    np.add.at(total, corner[smooth], areas[other[smooth]])
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return corners, np.where(size > 1e-12, total / np.maximum(size, 1e-12), normals[face])


def disc(centre: Floats, radius: float, sides: int = 48) -> tuple[Floats, NDArray[np.int64]]:
    """A flat disc normal to z: vertices (V, 3) [m] and triangles (F, 3), both of its faces."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(sides)])
    vertices = np.vstack([np.zeros(3), rim]) + centre
    here, onward = np.arange(sides) + 1, np.roll(np.arange(sides) + 1, -1)
    top = np.column_stack([np.zeros(sides, int), here, onward])
    return vertices, np.vstack([top, top[:, ::-1]])


def visible(line: Floats, width: int, height: int) -> list[Floats]:
    """The pieces (2, 2) of a line (N, 2) [px] that lie in the picture, in rerun's pixels.

    rerun counts from the picture's corner, so that pixel centres lie at halves.
    """
    # OpenCV clips integers: a sixteenth of a pixel is finer than the display
    points = np.round((np.asarray(line, float).reshape(-1, 2) + 0.5) * 16.0)
    if not np.isfinite(points).all():
        return []
    pieces = []
    for start, end in pairwise(np.clip(points, -(2.0**24), 2.0**24).astype(int).tolist()):
        inside, first, last = cv2.clipLine((0, 0, 16 * width, 16 * height), start, end)
        if inside:
            pieces.append(np.array([first, last]) / 16.0)
    return pieces


def _ground(rec: rr.RecordingStream) -> None:
    centres = ((np.arange(_TEXELS) + 0.5) / _TEXELS * 2 - 1) * _EXTENT
    east, north = np.meshgrid(centres, -centres)
    fade = np.clip(1.0 - np.hypot(east, north) / _EXTENT, 0.0, 1.0) ** 1.2
    mown = 1.0 + 0.05 * np.sign(np.sin(np.pi * east / 2.0) * np.sin(np.pi * north / 2.0))
    colour = NIGHT + (GRASS * mown[..., None] - NIGHT) * fade[..., None]
    square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * _EXTENT
    rec.log(
        "world/ground",
        rr.Mesh3D(
            vertex_positions=square + (0.0, 0.0, -0.02),
            triangle_indices=[(0, 1, 2), (0, 2, 3)],
            vertex_texcoords=[(0, 1), (1, 1), (1, 0), (0, 0)],
            albedo_texture=np.clip(colour, 0, 255).astype(np.uint8),
        ),
        static=True,
    )


def _pad(rec: rr.RecordingStream, mark: Mark) -> None:
    half = mark.square / 2
    _tiles(rec, "world/pad/ground", [(-half, -half, half, half)], -0.01, (62, 66, 72))
    vertices, faces, colours = [], [], []
    count, layer, before = 0, 0, None
    for shape in mark.shapes():
        # later paint lies on earlier paint
        layer += before not in (None, shape.tone)
        before = shape.tone
        height = layer * _COAT
        if isinstance(shape, Disc):
            corners, triangles = disc(np.array([shape.x, shape.y, height]), shape.radius)
        else:
            boxes = slabs(np.array(shape.corners))
            corners = np.array([(x, y, height) for box in boxes for x, y in _corners(*box)])
            first = 4 * np.arange(len(boxes))[:, None]
            triangles = np.concatenate([first + (0, 1, 2), first + (0, 2, 3)])
        vertices.append(corners)
        faces.append(triangles + count)
        colours.append(np.tile(_TONES[shape.tone], (len(corners), 1)))
        count += len(corners)
    rec.log(
        "world/pad/mark",
        rr.Mesh3D(
            vertex_positions=np.vstack(vertices),
            triangle_indices=np.vstack(faces),
            vertex_colors=np.vstack(colours).astype(np.uint8),
        ),
        static=True,
    )


def slabs(outline: Floats) -> list[tuple[float, float, float, float]]:
    """Rectangles (west, south, east, north) that make up a polygon (N, 2) whose edges run along the axes."""
    ends = np.roll(outline, -1, axis=0)
    upright = outline[:, 0] == ends[:, 0]
    x = outline[upright, 0]
    low, high = np.sort(np.column_stack([outline[upright, 1], ends[upright, 1]]), axis=1).T
    boxes = []
    for south, north in pairwise(np.unique(outline[:, 1]).tolist()):
        walls = np.sort(x[(low <= south) & (high >= north)]).tolist()
        boxes += [(west, south, east, north) for west, east in zip(walls[::2], walls[1::2], strict=True)]
    return boxes


def _tiles(
    rec: rr.RecordingStream,
    place: str,
    boxes: list[tuple[float, float, float, float]],
    height: float,
    colour: tuple[int, int, int],
) -> None:
    """Flat rectangles (west, south, east, north) [m] at one height."""
    vertices = [(x, y, height) for west, south, east, north in boxes for x, y in _corners(west, south, east, north)]
    first = 4 * np.arange(len(boxes))[:, None]
    faces = np.concatenate([first + (0, 1, 2), first + (0, 2, 3)])
    rec.log(place, rr.Mesh3D(vertex_positions=vertices, triangle_indices=faces, albedo_factor=colour), static=True)


def _corners(west: float, south: float, east: float, north: float) -> list[tuple[float, float]]:
    return [(west, south), (east, south), (east, north), (west, north)]
