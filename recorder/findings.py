"""What a check found wrong, in plain words, bounded however much is wrong."""

_KEEP = 500


class Findings:
    """A list of sentences.

    Attributes:
        total: how many there were, kept or not.
    """

    def __init__(self) -> None:
        self.total = 0
        self._kept: list[str] = []

    def add(self, text: str) -> None:
        """Note one finding."""
        self.total += 1
        if len(self._kept) < _KEEP:
            self._kept.append(text)

    def lines(self) -> tuple[str, ...]:
        """The findings; the last line says how many more there are."""
        more = self.total - len(self._kept)
        return (*self._kept, f"and {more} more") if more else tuple(self._kept)
