"""Arrays on disk, mapped into memory: what a long problem needs one part after the other."""

import mmap
import os
import tempfile
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, ClassVar, TypeVar, overload

import numpy as np
import numpy.typing as npt

Item = TypeVar("Item")

_SEGMENT = 2**26  # bytes reserved on disk at a time
_RESIDENT = 2**27  # bytes that are passed over before the pages of all arrays are given back


class DiskArrays:
    """Arrays in temporary files that end with them; they count as memory only while they are in use.

    The files are in the folder that ``TMPDIR`` names. On Linux space is reserved first: a full disk is an
    error here and nothing worse later.
    """

    _all_maps: ClassVar[list[weakref.ref[mmap.mmap]]] = []  # with arrays that are still in use
    _passed: ClassVar[int] = 0

    def __init__(self) -> None:
        self._maps: list[mmap.mmap] = []
        self._used = 0  # bytes of the last map
        self.size = 0  # bytes of all arrays

    def empty(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
        """Return an array of zeros in Fortran order.

        Raises:
            OSError: The disk is full.
        """
        kind = np.dtype(dtype)
        size = int(np.prod(shape, dtype=np.int64)) * kind.itemsize
        if not size:
            return np.zeros(shape, kind, order="F")
        if not self._maps or self._used + size > len(self._maps[-1]):
            self._maps.append(_mapped(max(size, _SEGMENT)))
            self._used = 0
            self._all_maps.append(weakref.ref(self._maps[-1], self._all_maps.remove))
        array: npt.NDArray[Any] = np.ndarray(shape, kind, self._maps[-1], self._used, order="F")
        self._used += -(-size // 64) * 64
        self.size += size
        return array

    def kept(self, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return a copy on disk, in C order."""
        copy = self.empty(array.shape[::-1], array.dtype).T
        copy[...] = array
        self.passed(copy.nbytes)
        return copy

    @staticmethod
    def passed(size: int) -> None:
        """Say that so many bytes of any arrays were in use and may leave the memory."""
        DiskArrays._passed += size
        if DiskArrays._passed > _RESIDENT:
            DiskArrays._passed = 0
            for one in (reference() for reference in tuple(DiskArrays._all_maps)):
                if one is not None:
                    one.madvise(mmap.MADV_DONTNEED)  # of a shared map: what was written stays


def _mapped(size: int) -> mmap.mmap:
    with tempfile.TemporaryFile(prefix="vgps-") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        else:
            file.truncate(size)
        return mmap.mmap(file.fileno(), size)


class DiskSequence(Sequence[Item]):
    """Items whose arrays are on disk; passing over them gives their memory back.

    Args:
        items: The items.
        sizes: Bytes of each.
    """

    def __init__(self, items: Sequence[Item], sizes: Sequence[int]) -> None:
        self._items, self._sizes = items, sizes

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, index: int) -> Item: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Item]: ...
    def __getitem__(self, index: int | slice) -> Item | Sequence[Item]:
        return self._items[index]

    def __iter__(self) -> Iterator[Item]:
        for item, size in zip(self._items, self._sizes, strict=True):
            yield item
            DiskArrays.passed(size)


def stored(items: Iterable[Item], store: Callable[[Item, DiskArrays], Item]) -> DiskSequence[Item]:
    """Return items with their arrays on disk.

    Args:
        items: The items, taken one by one.
        store: Returns an item with its arrays among those given.
    """
    arrays, kept, sizes = DiskArrays(), [], []
    for item in items:
        before = arrays.size
        kept.append(store(item, arrays))
        sizes.append(arrays.size - before)
    return DiskSequence(kept, sizes)
