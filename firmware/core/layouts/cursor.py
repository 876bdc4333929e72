"""Places in a vector, handed out one after the other: a layout names its parts in their order, and counts nothing."""


class Cursor:
    """Hands out the places of one vector; `size` is the next free place, and in the end the vector's length."""

    def __init__(self) -> None:
        self.size = 0

    def __call__(self, width: int = 1) -> int:
        """Return the place where a part of `width` numbers begins."""
        start = self.size
        self.size += width
        return start

    def each(self, names: int) -> range:
        """Return the places of so many single numbers, to be unpacked: Python refuses more names, or fewer."""
        start = self(names)
        return range(start, self.size)
