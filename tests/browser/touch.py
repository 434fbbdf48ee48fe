"""Fingers on a page, told to the browser as a touch screen does."""

from collections.abc import Sequence

from playwright.sync_api import Page

Place = tuple[float, float]


class Fingers:
    """Fingers on the screen.

    Args:
        page: that is touched.
    """

    def __init__(self, page: Page) -> None:
        self._session = page.context.new_cdp_session(page)

    def down(self, *places: Place) -> None:
        """Fingers are put down, so that those at these places, CSS px, are on the screen."""
        self._tell("touchStart", places)

    def move(self, *places: Place) -> None:
        """All fingers on the screen go to these places."""
        self._tell("touchMove", places)

    def up(self) -> None:
        """All fingers leave the screen."""
        self._tell("touchEnd", ())

    def drag(self, *ways: tuple[Place, Place], steps: int = 4) -> None:
        """Fingers go from where they are put down to where they are lifted, each its way."""
        self.down(*(begin for begin, _ in ways))
        for step in range(1, steps + 1):
            share = step / steps
            self.move(*((x + share * (to_x - x), y + share * (to_y - y)) for (x, y), (to_x, to_y) in ways))
        self.up()

    def swipe(self, at: Place, right: float = 0.0, down: float = 0.0) -> None:
        """One finger goes so far, CSS px, from a place."""
        self.drag((at, (at[0] + right, at[1] + down)))

    def _tell(self, kind: str, places: Sequence[Place]) -> None:
        points = [{"x": float(x), "y": float(y), "id": number} for number, (x, y) in enumerate(places)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
