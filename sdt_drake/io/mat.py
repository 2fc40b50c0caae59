"""Matrices of numbers in .mat files of MATLAB and Octave.

Files of version 5 are read here, because scipy allocates any memory that such a file declares and
crashes on deeply nested structures. The format: "MAT-File Format", MathWorks, chapter 1.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.errors import InputError

_HEADER, _TAG = 128, 8  # bytes
_NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""Types of numpy by types of elements."""
_MATRIX, _COMPRESSED = 14, 15  # types of other elements
_STRUCTURE, _NUMERIC = 2, range(6, 16)  # classes of matrices
_CLASS, _COMPLEX = 0xFF, 0x800  # parts of the flags
_MAX_DEPTH = 20  # nested structures
_MAX_MATRICES = 100_000

Matrix = np.ndarray[Any, np.dtype[Any]]


def read_mat(path: Path, max_bytes: int) -> dict[str, Matrix]:
    """Read the matrices of real numbers by name. A matrix in a structure is structure.name.

    Args:
        path: the file.
        max_bytes: largest size after decompression.

    Raises:
        InputError: too many bytes or matrices, or structures too deep.
        Exception: any type, if the file is no MAT file.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import matfile_version

    if matfile_version(path)[0] == 1:
        found = dict(_File(path.read_bytes(), max_bytes).matrices())
    else:  # version 4 has no structures; scipy refuses 7.3
        found = {k: v for k, v in loadmat(path).items() if isinstance(v, np.ndarray)}
    return {k: v for k, v in found.items() if v.dtype.kind in "iuf" and v.ndim == 2 and v.size > 1}


class _File:
    """The content of a file of version 5."""

    def __init__(self, data: bytes, max_bytes: int) -> None:
        self._data, self._count = data, 0
        self._max_bytes = self._left = max_bytes
        self._order = "<" if data[_HEADER - 2 : _HEADER] == b"IM" else ">"

    def matrices(self) -> Iterator[tuple[str, Matrix]]:
        """Yield names and values of all matrices of real numbers."""
        for kind, element in self._elements(memoryview(self._data)[_HEADER:]):
            if kind == _COMPRESSED:
                inner = zlib.decompressobj().decompress(element, self._left + 1)
                self._left -= len(inner)
                if self._left < 0:
                    raise InputError(f"more than {self._max_bytes} bytes without compression")
                kind, element = next(self._elements(memoryview(inner)))
            if kind == _MATRIX:
                yield from self._matrices(element, "", 0)

    def _elements(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Yield type and content of each element. Up to four bytes are inside the tag."""
        at = 0
        while at + _TAG <= len(data):
            kind, size = struct.unpack_from(f"{self._order}2I", data, at)
            if small := kind >> 16:
                yield kind & 0xFFFF, data[at + 4 : at + 4 + small]
                at += _TAG
                continue
            yield kind, data[at + _TAG : at + _TAG + size]
            at += _TAG + size + (0 if kind == _COMPRESSED else -size % 8)

    def _matrices(self, data: memoryview, name: str, depth: int) -> Iterator[tuple[str, Matrix]]:
        """Yield a matrix of numbers, or all matrices in a structure."""
        self._count += 1
        if depth > _MAX_DEPTH or self._count > _MAX_MATRICES:
            raise InputError(f"more than {_MAX_MATRICES} matrices, or {_MAX_DEPTH} nested")
        if not data:  # an empty field
            return
        parts = self._elements(data)
        flags = int(self._numbers(next(parts))[0])
        shape = tuple(map(int, self._numbers(next(parts))))
        name += str(next(parts)[1], "ascii")
        kind = flags & _CLASS
        if kind in _NUMERIC and not flags & _COMPLEX:
            yield name, self._numbers(next(parts)).reshape(shape, order="F")
        elif kind == _STRUCTURE and shape == (1, 1):
            width = int(self._numbers(next(parts))[0])
            texts = bytes(next(parts)[1])
            fields = [texts[at : at + width] for at in range(0, len(texts), max(width, 1))]
            for field, (_, inner) in zip(fields, parts, strict=False):
                own = str(field.partition(b"\0")[0], "ascii")
                yield from self._matrices(inner, f"{name}.{own}", depth + 1)

    def _numbers(self, element: tuple[int, memoryview]) -> Matrix:
        kind, data = element
        return np.frombuffer(data, f"{self._order}{_NUMBERS[kind]}")
