"""Arrays as callers have them -> arrays as the library reads them, or an error that says what is
wrong.

Nothing is copied that already has the right type and lies in one run.
"""

from __future__ import annotations

import operator
import os
from typing import Any

import numpy as np

from ._core import InputError

FLOAT32 = np.dtype(np.float32)
FLOAT64 = np.dtype(np.float64)
UINT32 = np.dtype(np.uint32)
MISSING = 0xFFFFFFFF
"""Stands for "nothing" in arrays of indices: no triangle was hit, no point is near."""
ALL = 0xFFFFFFFF
"""The mask that has a bit in common with every other one but 0."""

# DLPack's numbers of devices whose memory the processor can read.
_READABLE_DEVICES = (1, 3, 13)


def to_numpy(value: Any, name: str) -> np.ndarray:
    """`value` as NumPy has it: itself, a view of another library's array (DLPack), or a new array.

    TypeError if it is no array of numbers or its memory is a device's. InputError if values of it
    are masked.
    """
    if isinstance(value, np.ndarray):
        if np.ma.is_masked(value):
            raise InputError(f"{name}: expected no masked values, given {int(value.mask.sum())}")
        # Columns of np.matrix keep two dimensions: what is not a plain array is seen as one.
        return value if type(value) is np.ndarray else value.view(np.ndarray)
    if hasattr(value, "__dlpack__") and hasattr(value, "__dlpack_device__"):
        device = int(value.__dlpack_device__()[0])
        if device not in _READABLE_DEVICES:
            raise TypeError(
                f"{name}: expected an array in the processor's memory, given a "
                f"{type(value).__name__} on another "
                f"device (DLPack {device}); only intersect and occluded of a Scene with device='cuda' take those"
            )
        try:
            return np.from_dlpack(value)
        except (BufferError, RuntimeError, TypeError):
            pass  # an older NumPy and a read-only array, for example: a copy will do
    try:
        return np.asarray(value)
    except (ValueError, TypeError, RuntimeError) as error:
        raise TypeError(
            f"{name}: expected an array of numbers, given {type(value).__name__} "
            f"({' '.join(str(error).split())})"
        ) from None


def describe(array: np.ndarray) -> str:
    return f"shape {array.shape} {array.dtype}"


def shown(value: Any) -> str:
    """A wrong value on one line of a message: arrays by shape and type, long ones cut off."""
    if isinstance(value, np.ndarray) or hasattr(value, "__dlpack__"):
        shape, dtype = getattr(value, "shape", None), getattr(value, "dtype", None)
        return f"an array of shape {tuple(shape or ())} {dtype}"
    try:
        text = " ".join(repr(value).split())
    except Exception:  # of any class, which may say anything; or of a whole number too long
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:77]}..."


def _as_floats(array: np.ndarray, name: str, expected: str) -> np.ndarray:
    """float32 and float64 as they are, in this machine's byte order; whole numbers and float16 as
    float64."""
    if array.dtype == FLOAT32 or array.dtype == FLOAT64:
        return array
    kind = array.dtype.kind
    if kind == "f" and array.dtype.itemsize == 4:
        return array.astype(FLOAT32)
    if kind in "iuf" or (kind == "b" and array.size == 0):
        return array.astype(FLOAT64)
    raise TypeError(f"{name}: expected {expected} float32 or float64, given {describe(array)}")


def floats(value: Any, name: str, columns: tuple[int, ...]) -> np.ndarray:
    """An array (..., C) of float32 or float64, C one of `columns`."""
    array = to_numpy(value, name)
    expected = "shape " + " or ".join(f"(..., {c})" for c in columns)
    if array.size == 0 and array.ndim == 1 and array.shape[0] == 0:
        array = array.reshape(0, columns[0])  # [] has no second axis, but it is plain what is meant
    if array.ndim == 0 or array.shape[-1] not in columns:
        error = TypeError if array.dtype.kind not in "iufb" else ValueError
        raise error(f"{name}: expected {expected} float32 or float64, given {describe(array)}")
    return _as_floats(array, name, expected)


def cast(array: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """In one run, of this type, and where such numbers may lie; float64 beyond float32 becomes
    infinite."""
    if array.dtype == dtype and array.flags.c_contiguous and array.flags.aligned:
        return array
    with np.errstate(over="ignore"):
        return np.require(array, dtype, ("C", "A"))


def rows(
    value: Any, name: str, columns: tuple[int, ...], dtype: np.dtype
) -> tuple[np.ndarray, tuple[int, ...]]:
    """(n, C) in one run and of `dtype`, and the leading shape that it had."""
    if (
        type(value) is np.ndarray
        and value.dtype == dtype
        and value.ndim == 2
        and value.shape[1] in columns
    ):
        return cast(value, dtype), value.shape[:1]
    array = floats(value, name, columns)
    return cast(array, dtype).reshape(-1, array.shape[-1]), array.shape[:-1]


def number(value: Any, name: str) -> float:
    """Any real number as a float."""
    is_other_array = getattr(value, "ndim", 0) or (
        isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind not in "biuf"
    )
    if not isinstance(value, (str, bytes, bytearray)) and not is_other_array:
        try:
            return float(value)
        except OverflowError:
            raise InputError(
                f"{name}: expected a number that float64 can hold, given {shown(value)}"
            ) from None
        except (TypeError, ValueError):
            pass
    raise TypeError(f"{name}: expected a number, given {shown(value)}")


def flag(value: Any, name: str) -> bool:
    """A bool, NumPy's too, or 0 or 1."""
    if isinstance(value, (bool, np.bool_)) or (type(value) is int and value in (0, 1)):
        return bool(value)
    raise TypeError(f"{name}: expected True or False, given {shown(value)}")


def text(value: Any, name: str) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a str, given {shown(value)}")
    return value.encode("utf-8", "replace").decode()


def one_of(value: Any, name: str, known: Any) -> str:
    if not isinstance(value, str) or value not in known:
        raise InputError(
            f"{name}: expected one of {', '.join(map(str, known))}, given {shown(value)}"
        )
    return value


def path(value: Any, name: str) -> bytes:
    """A path as the system has it: str, also of a name that is no UTF-8, bytes, or os.PathLike."""
    try:
        return os.fsencode(value)
    except UnicodeEncodeError:
        raise InputError(f"{name}: no path can be {shown(value)}") from None
    except TypeError:
        raise TypeError(f"{name}: expected a path, given {shown(value)}") from None


def own_attributes(thing: Any, made: tuple[str, ...]) -> dict[str, Any] | None:
    """What an object carries besides the attributes that its class made; None: nothing."""
    return {name: own for name, own in vars(thing).items() if name not in made} or None


def result_bytes(value: Any) -> int:
    return whole(value, "max_result_bytes", 0, 2**64 - 1)


def whole(value: Any, name: str, least: int, most: int) -> int:
    """A whole number from `least` to `most`; floats that are whole count."""
    error: type[Exception] = InputError
    try:
        found = operator.index(value)
        if least <= found <= most:
            return found
    except TypeError:
        if not isinstance(value, (float, np.floating)):
            error = TypeError
        elif np.isfinite(value) and value == np.floor(value) and least <= int(value) <= most:
            return int(value)
    raise error(f"{name}: expected a whole number, {least} to {most}, given {shown(value)}")


def uint32s(value: Any, name: str) -> np.ndarray:
    """Whole numbers from 0 to 2**32 - 1, of any shape."""
    array = to_numpy(value, name)
    if array.size == 0:
        return np.zeros(array.shape, UINT32)
    if array.dtype.kind not in "iu":
        raise TypeError(f"{name}: expected whole numbers, given {describe(array)}")
    if array.min() < 0 or array.max() > ALL:
        raise ValueError(f"{name}: expected 0 to {ALL}, given {array.min()} to {array.max()}")
    return cast(array, UINT32)


def code_bits(value: Any) -> int:
    """Of Morton codes."""
    found = whole(value, "bits", 30, 63)
    if found not in (30, 63):
        raise InputError(f"bits: expected 30 or 63, given {found}")
    return found


def thread_count(value: Any) -> int:
    """0, all the machine has, to 1024."""
    return whole(value, "threads", 0, 1024)


def float_type(value: Any, name: str) -> np.dtype:
    """float32 for None; else what "float32", np.float64 and the like stand for."""
    expected = f"{name}: expected 'float32' or 'float64', given {shown(value)}"
    try:
        dtype = FLOAT32 if value is None else np.dtype(value)
    except Exception:  # NumPy raises several kinds of what is no type
        raise ValueError(expected) from None
    if dtype not in (FLOAT32, FLOAT64):
        raise ValueError(expected)
    return dtype


def require_float32(scene: Any, what: str) -> None:
    """NotImplementedError if the scene is in float64, which `what` does not know."""
    if scene.dtype != FLOAT32:
        raise NotImplementedError(
            f"{what}: not there for a scene in float64; make one with precision='float32', "
            "of vertices moved near the origin if they are far from it"
        )


def require_dtype(scene: Any, dtype: np.dtype, name: str) -> None:
    """TypeError unless a scene that another one, in `dtype`, is given is in that type too."""
    if scene.dtype != dtype:
        raise TypeError(
            f"{name}: expected a scene in {dtype}, as this one, given one in {scene.dtype}"
        )


def mesh_vertices(value: Any, name: str = "vertices", dtype: np.dtype = FLOAT32) -> np.ndarray:
    """(V, 3) of `dtype`. This is the one place where a mesh's float64 coordinates are rounded."""
    array = floats(value, name, (3,))
    if array.ndim != 2:
        raise ValueError(
            f"{name}: expected shape (V, 3) float32 or float64, given {describe(array)}"
        )
    return cast(array, dtype)


def mesh_faces(value: Any, vertex_count: int, name: str = "faces") -> np.ndarray:
    """(F, 3) uint32. Negative indices and those past the vertices are a ValueError that names the
    first."""
    array = to_numpy(value, name)
    if array.size == 0:
        return np.zeros((0, 3), UINT32)
    expected = f"{name}: expected shape (F, 3) of whole numbers, given {describe(array)}"
    if array.dtype.kind not in "iu":
        raise TypeError(expected)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(expected)
    if array.min() < 0 or array.max() >= vertex_count:
        row = int(np.argmax(((array < 0) | (array >= vertex_count)).any(axis=1)))
        raise ValueError(
            f"{name}: face {row} is {array[row].tolist()}, but there are {vertex_count} vertices "
            f"(0 to {vertex_count - 1})"
        )
    return cast(array, UINT32)
