"""Pictures of scenes, rays of cameras, and what a notebook shows."""

from __future__ import annotations

import base64
import html
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import (
    FLOAT32,
    cast,
    describe,
    flag,
    floats,
    number,
    one_of,
    path,
    rows,
    shown,
    whole,
)
from .cameras import Camera

KINDS = ("ao", "diffuse", "diffuse_shuffled")
VIEWS = ("shaded", "normal", "depth", "primitive", "ao", "diffuse", "steps", "path")


class SceneViews:
    """What a Scene shows of itself."""

    _core: Any
    dtype: np.dtype
    _cameras: list[Camera]
    _fitted: Camera | None  # until the scene changes
    threads: int
    name: str

    @property
    def cameras(self) -> list[Camera]:
        """Those that came with the file or the built-in scene, else one that sees all of the
        scene."""
        if self._cameras:
            return list(self._cameras)
        fitted = self._fitted
        if fitted is None:
            with self._core.held():  # no commit comes between the making and the keeping
                is_mesh = self._core.is_mesh()
                lo, hi = self._core.info()["bounds"] if is_mesh else self._core.bounds()
                if not lo[0] <= hi[0]:
                    return [Camera()]
                fitted = self._fitted = Camera(**self._core.fit_camera(lo, hi, 45.0))
        return [fitted]

    def _camera(self, camera: Camera | int | None) -> Camera:
        if isinstance(camera, Camera):
            return camera
        known = self.cameras
        if camera is None:
            return known[0]
        return known[whole(camera, "camera", -len(known), len(known) - 1)]

    def render(
        self,
        camera: Camera | int | None = None,
        *,
        view: str = "shaded",
        size: tuple[int, int] = (1024, 768),
        samples: int = 0,
        ao_radius: float = 0.0,
        seed: int = 1,
    ) -> np.ndarray:
        """A picture of linear colours: shape (height, width, 3) float32, rows from the top.

        `view`: "shaded" (sun and sky, a lamp in closed rooms), "normal", "depth", "primitive",
        "ao", "diffuse", "steps" (node visits) or "path" (up to eight bounces of light).
        `camera`: one of `cameras` by its number, -1 for the last, or a `Camera`; None: the first.
        `size`: (width, height), each 1 to 16384.
        `samples`: rays a pixel that gather light, 1 to 4096; 0: 64 for "ao" and "path", 32 for
        "diffuse", 16 for "shaded". `ao_radius`: 0 means 5 % of the diagonal. The same picture for every number of
        threads. Ctrl-C ends it. `raydix.to_srgb` makes 8-bit colours of it.

        A scene in float64 is met in float64, wherever it lies; light is then gathered in float32 about
        the middle of its box. It does not count steps: ValueError for that view.
        """
        return self._core.render(
            self._camera(camera)._fields(),
            one_of(view, "view", VIEWS),
            *_pixels(size),
            whole(samples, "samples", 0, 4096),
            number(ao_radius, "ao_radius"),
            whole(seed, "seed", 0, 2**64 - 1),
            self.threads,
        )

    def primary_rays(
        self, camera: Camera | int | None = None, *, size: tuple[int, int] = (1024, 768)
    ) -> dict[str, np.ndarray]:
        """One ray for each pixel centre, pixels in 2-D Morton order (neighbours in the picture are
        neighbours in the batch).

        Returns "rays" (N, 8) in the scene's type with unit directions, and "pixels" (N,) uint32:
        y * width + x.
        """
        rays, pixels = self._core.primary_rays(self._camera(camera)._fields(), *_pixels(size))
        return {"rays": rays, "pixels": pixels}

    def secondary_rays(
        self,
        rays: ArrayLike,
        kind: str = "ao",
        *,
        samples: int = 32,
        ao_radius: float = 0.0,
        seed: int = 1,
    ) -> np.ndarray:
        """Rays from where `rays` hit, `samples` each, (M, 8) in the scene's type: "ao", "diffuse" or
        "diffuse_shuffled".

        Halton points, cosine-weighted about the normal (Aila, Laine 2009), sorted by origin and
        direction. Rays that miss have none. Spheres, capsules and points have the normals that
        `normals` gives. Those of a scene in float64 have directions of float32
        numbers, and origins with an error of 2**-24 of the diagonal of the scene's box at most: a
        fiftieth of the distance that they keep from the surface.
        """
        primary, _ = rows(rays, "rays", (8,), self.dtype)
        return self._core.secondary_rays(
            primary,
            one_of(kind, "kind", KINDS),
            whole(samples, "samples", 1, 1024),
            number(ao_radius, "ao_radius"),
            whole(seed, "seed", 0, 2**64 - 1),
            self.threads,
        )

    def _facts(self) -> tuple[list[tuple[str, str]], Any]:
        """What a notebook shows in a table, and the corners of the box around what can be seen."""
        if not self._core.is_mesh():
            box = self._core.bounds()
            return [("geometries", f"{len(self._core):,}"), ("bounds", _corners(box))], box
        info, wide = self._core.info(), self._core.wide_stats()
        tree = f"{wide['nodes']:,} nodes, depth {wide['max_depth']}, {wide['bytes'] / 1e6:.2f} MB"
        return [
            ("triangles", f"{info['triangles']:,}"),
            ("vertices", f"{info['vertices']:,}"),
            ("left out", f"{info['left_out_triangles']:,}"),
            ("without area", f"{info['zero_area_triangles']:,}"),
            ("bounds", _corners(info["bounds"])),
            ("tree", tree),
            ("built in", f"{wide['ms']:.1f} ms"),
        ], self._core.bounds()

    def _repr_html_(self) -> str | None:
        """Statistics and a small picture, for notebooks, which show `repr` for None."""
        try:
            lines, (lo, hi) = self._facts()
        except _core.InputError:  # it was never committed
            return None
        cells = "".join(
            f"<tr><th style='text-align:left'>{k}</th><td>{html.escape(v)}</td></tr>"
            for k, v in lines
        )
        picture = ""
        if lo[0] <= hi[0]:
            png = to_png(self.render(size=(240, 180), samples=4))
            data = base64.b64encode(png).decode()
            picture = f"<img width=240 height=180 src='data:image/png;base64,{data}'>"
        title = html.escape(self.name or "raydix.Scene")
        shown = f"{picture}<table>{cells}</table>"
        return f"<div><b>{title}</b><div style='display:flex;gap:1em'>{shown}</div></div>"


def _pixels(size: Any) -> tuple[int, int]:
    is_row = isinstance(size, (tuple, list)) or getattr(size, "ndim", 0) == 1
    if not is_row or len(size) != 2:
        raise TypeError(f"size: expected (width, height), given {shown(size)}")
    return whole(size[0], "size, width", 1, 16384), whole(size[1], "size, height", 1, 16384)


def _corners(box: Any) -> str:
    return " to ".join(str(tuple(round(c, 4) for c in corner)) for corner in box)


def _picture(value: ArrayLike) -> np.ndarray:
    picture = floats(value, "picture", (3,))
    if picture.ndim != 3:
        raise ValueError(f"picture: expected shape (height, width, 3), given {describe(picture)}")
    return cast(picture, FLOAT32)


def _of_pixels(value: ArrayLike) -> np.ndarray:
    """A picture that a file can hold."""
    picture = _picture(value)
    if picture.size == 0:
        raise _core.InputError(f"picture: expected at least one pixel, given {describe(picture)}")
    return picture


def to_srgb(picture: ArrayLike) -> np.ndarray:
    """Linear colours (H, W, 3) -> 8-bit sRGB of the same shape (uint8), clamped to [0, 1], without
    a tone curve."""
    linear = np.clip(_picture(picture), 0.0, 1.0)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)
    return np.rint(coded * 255.0).astype(np.uint8)


def to_png(picture: ArrayLike, *, tone_map: bool = True) -> bytes:
    """Linear colours (H, W, 3) -> the bytes of a PNG file, 8-bit sRGB; `tone_map`: after a filmic
    curve."""
    return _core.png(_of_pixels(picture), flag(tone_map, "tone_map"))


def save_picture(file: str | bytes | os.PathLike, picture: ArrayLike, *, tone_map: bool = True) -> None:
    """Writes linear colours (H, W, 3) as .png (8-bit sRGB) or .exr (float). InputError names the
    file."""
    _core.save_picture(path(file, "file"), _of_pixels(picture), flag(tone_map, "tone_map"))
