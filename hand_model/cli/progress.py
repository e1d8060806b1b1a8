"""Progress on stderr: one line per result as it comes and, on a terminal, a bar below them."""

from __future__ import annotations

from typing import TextIO

WIDTH = 30


class Progress:
    """Called with one line per result. bar: whether `share` draws; on a terminal only, a file keeps lines."""

    def __init__(self, stream: TextIO, lines: bool, bar: bool) -> None:
        self.stream, self.lines, self.bar = stream, lines, bar
        self._drawn = ""

    def __call__(self, line: str) -> None:
        if self.lines:
            drawn = self._drawn
            self.clear()
            print(line, file=self.stream, flush=True)
            self._draw(drawn)

    def share(self, done: float) -> None:
        """Draw how much of the work is done, 0 to 1; nothing is left of the bar when all is."""
        if self.bar:
            full = round(WIDTH * min(max(done, 0.0), 1.0))
            self.clear()
            if done < 1:
                self._draw(f"[{'#' * full}{'.' * (WIDTH - full)}] {100 * done:3.0f} %")

    def clear(self) -> None:
        """Take the bar off the screen."""
        if self._drawn:
            self._draw("\r" + " " * len(self._drawn) + "\r")
            self._drawn = ""

    def _draw(self, text: str) -> None:
        if text:
            print(text, end="", file=self.stream, flush=True)
            self._drawn = text
