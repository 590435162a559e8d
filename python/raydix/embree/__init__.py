"""Scenes and meshes in the shape of `embreex`, for code that is written for it.

    from raydix.embree import rtcore_scene
    from raydix.embree.mesh_construction import TriangleMesh

What differs: meshes that come after the first `run` are seen by the next one; arrays of float64 are
rounded to float32 and not refused; of two triangles at the same distance the lower (mesh, triangle)
answers; no ray slips through an edge, whatever `robust` is.
"""

from . import mesh_construction, rtcore_scene

__version__ = "4.4.0"
"""The version of embreex whose calls these are."""

__all__ = ["mesh_construction", "rtcore_scene"]
