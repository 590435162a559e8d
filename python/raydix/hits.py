"""Hits: what rays and all_hits return."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ._arrays import MISSING, UINT32

COLUMNS = ("t", "prim", "u", "v", "geometry", "instance")
"""What every hit has."""

# Which scalar of a row, and which uint32 where a whole number has the room of a scalar.
_FLOATS = {"t": 0, "u": 2, "v": 3}
_WORDS = {"prim": 1, "geometry": 4, "instance": 5}
_WORDS_OF_DOUBLES = {"prim": 2, "geometry": 8, "instance": 9}


class Hits(Mapping):
    """Hits of rays: a dict of arrays whose keys are attributes too, `hits["t"]` and `hits.t`.

    It has "t", "prim", "u", "v", "geometry" and "instance", each with the leading shape of the
    rays; of `all_hits` also "offsets"; and what the call was asked for: "position", "normal", names
    of vertex attributes. The arrays are views of the rows that the library wrote, made when they
    are asked for. `dict(hits)` is a dict of them.
    """

    __slots__ = ("_columns", "_ids", "_more", "_rows")

    def __init__(self, rows: np.ndarray, more: dict[str, np.ndarray] | None = None) -> None:
        self._rows = rows
        self._more = more
        self._columns: dict[str, np.ndarray] | None = None
        self._ids: np.ndarray | None = None

    @property
    def hit(self) -> np.ndarray:
        """Whether each ray hit anything: bool."""
        return self["prim"] != MISSING

    def _made(self, name: str) -> np.ndarray:
        place = _FLOATS.get(name)
        if place is not None:
            return self._rows[..., place]
        place = (_WORDS if self._rows.itemsize == 4 else _WORDS_OF_DOUBLES).get(name)
        if place is not None:
            if self._ids is None:
                self._ids = self._rows.view(UINT32)
            return self._ids[..., place]
        if self._more is not None and name in self._more:
            return self._more[name]
        raise KeyError(name)

    def __getitem__(self, name: str) -> np.ndarray:
        columns = self._columns
        if columns is None:
            columns = self._columns = {}
        found = columns.get(name)
        if found is None:
            found = columns[name] = self._made(name)
        return found

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):  # a slot that is not filled yet
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError:
            raise AttributeError(
                f"no {name!r} in these hits; they have {', '.join(self)}"
            ) from None

    def __iter__(self) -> Iterator[str]:
        yield from COLUMNS
        yield from self._more or ()

    def __len__(self) -> int:
        return len(COLUMNS) + len(self._more or ())

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self})

    def __eq__(self, other: Any) -> bool:
        """Whether both have the same keys and, bit for bit, the same arrays."""
        if not isinstance(other, Mapping):
            return NotImplemented
        return list(self) == list(other) and all(_same(self[name], other[name]) for name in self)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        shape = self._rows.shape[:-1]
        hit = int(np.count_nonzero(self.hit))
        return f"<raydix.Hits: shape {shape}, {hit:,} hits, {', '.join(self)}>"

    def __reduce__(self) -> tuple:
        return Hits, (self._rows, self._more)

    def __copy__(self) -> Hits:
        return Hits(self._rows, self._more)


def _same(a: Any, b: Any) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
