"""Scenes as files, as bytes for other processes, and as copies."""

from __future__ import annotations

import os
import tempfile
from typing import Any

import numpy as np

from . import _core
from ._arrays import ALL, own_attributes, path, text
from .cameras import Camera


_OWN = (
    *("dtype", "threads", "device", "name"),
    *("_core", "_file", "_options", "_cameras", "_fitted", "_there"),
)
"""What a scene makes for itself."""


class SavedScene:
    """How a Scene is written, pickled and copied."""

    _core: Any
    dtype: np.dtype
    name: str
    threads: int
    device: str
    committed: bool
    _options: dict[str, Any]
    _cameras: list[Camera]
    _file: tuple[Any, int, int, int] | None

    @property
    def options(self) -> dict[str, Any]:
        """What the scene was made with, and what `commit` changed since: a new dict of the
        arguments of `Scene` by their names. Scenes with equal options are built alike."""
        return dict(self._options)

    def save(self, file: str | bytes | os.PathLike) -> None:
        """Writes the scene to a .rdx file, as its last commit left it: its trees, all scenes that
        it places, each once, with ids and masks, its name and its cameras. `load_scene` reads it.

        In float64 the file holds no trees, and every number as it is: `load_scene` builds them.
        A reader never sees half a file. InputError: changes without a commit, a file that cannot be
        written.
        """
        cameras = [camera._fields() for camera in self._cameras]
        self._core.save_rdx(path(file, "file"), text(self.name, "name"), cameras)

    def __reduce_ex__(self, protocol: Any) -> tuple:
        """Pickles, copies and deep copies.

        - A scene of `load_scene` that has not changed is its file's path: the process that reads it
          maps the same file, and both share its memory.
        - A scene of one mesh is its arrays; its trees are built again.
        - Any other is the bytes of its .rdx file.

        The copy is of the same class, with the attributes that the scene was given.

        InputError: changes without a commit.
        """
        with self._core.held():
            return *self._reduced(), own_attributes(self, _OWN)

    def _reduced(self) -> tuple:
        ids, given = self._core.ids(), self._core.ids_given()
        committed = self.committed
        if not committed and given:
            raise _core.InputError("the scene has changes without a commit: it cannot be copied")
        more = {
            "type": type(self),
            "refit_limit": self._core.refit_limit(),
            "options": self._options,
            "name": self.name,
            "cameras": self._cameras,
            "attributes": {id: own for id in ids if (own := self._core.attributes(id))},
            "threads": self.threads,
            "device": self.device,
            "committed": committed,
        }
        if self._file is not None and self._file == state_of(self._file[0]):
            return _from_file, (self._file, more)
        if not given:
            return _from_mesh, (None, more)
        if ids == [0] and given == 1 and self._is_plain_mesh():
            return _from_mesh, (self._core.arrays_of(0), more)
        return _from_bytes, (self._bytes(), more)

    def _is_plain_mesh(self) -> bool:
        """Of a scene that was given the id 0 alone: whether `Scene(vertices, faces)` makes the
        same."""
        return (
            self._core.is_mesh()
            and self._core.mask_of(0) == ALL
            and self._core.arrays_of(0) is not None
        )

    def _bytes(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "scene.rdx")
            self.save(file)
            with open(file, "rb") as saved:
                return saved.read()


def _new(more: dict[str, Any], *mesh: np.ndarray) -> Any:
    from .scene import Scene

    scene = object.__new__(more.get("type", Scene))
    Scene.__init__(scene, *mesh, **more["options"])
    return scene


def _filled(scene: Any, more: dict[str, Any]) -> Any:
    from .scene import tree_options

    scene.name, scene._cameras = more["name"], list(more["cameras"])
    scene._options = dict(more["options"])
    scene._core.set_options(*tree_options(scene._options), more.get("refit_limit", 1.5))
    for id, own in more["attributes"].items():
        for name, (numbers, columns) in own.items():
            scene._core.set_attribute(id, name, numbers.reshape(-1), columns)
    return scene


def _from_mesh(mesh: tuple[np.ndarray, np.ndarray] | None, more: dict[str, Any]) -> Any:
    scene = _new(more, *mesh) if mesh else _new(more)
    if not mesh and more.get("committed"):
        scene.commit()
    return _filled(scene, more)


def state_of(file: Any) -> tuple[Any, int, int, int] | None:
    """What a file that is replaced or written to does not have any more; None: it is gone."""
    try:
        found = os.stat(file)
    except OSError:
        return None
    return file, found.st_size, found.st_mtime_ns, found.st_ino


def _read(file: Any, more: dict[str, Any]) -> Any:
    from .scene import Scene, read_scene

    return read_scene(more.get("type", Scene), file, more["threads"], more["device"])


def _from_file(file: tuple[Any, int, int, int], more: dict[str, Any]) -> Any:
    if state_of(file[0]) != file:
        raise _core.InputError(
            f"{os.fsdecode(file[0])}: it has changed since the scene was pickled, or is gone"
        )
    return _filled(_read(file[0], more), more)


def _from_bytes(saved: bytes, more: dict[str, Any]) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "scene.rdx")
        with open(file, "wb") as copy:
            copy.write(saved)
        scene = _read(file, more)
    scene._file = None  # the file is gone: its pages stay for as long as they are mapped
    return _filled(scene, more)
