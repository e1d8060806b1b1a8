"""How pictures look: matplotlib drawn small, as SVG whose colours are the page's own, so that it follows light and
dark.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

# Colours that stand for the page's CSS variables; replaced when the SVG is written.
INK, MUTED, LINE, PAPER = "#010203", "#020304", "#030405", "#040506"
SERIES = ("#110101", "#110102", "#110103", "#110104", "#110105")
_VARIABLES = {INK: "--ink", MUTED: "--muted", LINE: "--line", PAPER: "--paper"} | {
    c: f"--c{i + 1}" for i, c in enumerate(SERIES)
}
# Inches of a small picture; on a phone it is as wide as the screen.
WIDTH, HEIGHT = 4.2, 2.7
# Inches left, right, below (with and without a name of the axis) and above the panels: "-15000" and the axis' name
# beside each
# other on the left, half a "15000" on the right.
MARGINS = (0.68, 0.18, 0.42, 0.24, 0.08)

_SETTINGS: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hand_model",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": MUTED,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.major.size": 0,
    "ytick.major.size": 0,
    "text.color": INK,
    "lines.linewidth": 1.3,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "path.simplify": True,
}


class Drawing:
    """A picture in the making. panels: matplotlib Axes one below the other, axes: the first. svg: set when the
    `drawing` block ends.
    """

    def __init__(self, figure: Any, panels: tuple[Any, ...]) -> None:
        self.figure, self.panels, self.axes, self.svg = figure, panels, panels[0], b""


@contextmanager
def drawing(width: float = WIDTH, height: float = HEIGHT, panels: Sequence[float] = (1.0,)) -> Iterator[Drawing]:
    """`with drawing() as d: d.axes.plot(...)`; afterwards `d.svg` holds the bytes.

    width, height: inches. panels: relative heights of panels one below the other, on one horizontal axis.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # a user's own settings would change the bytes
        matplotlib.rcParams.update(_SETTINGS)
        figure = Figure(figsize=(width, height))
        canvas = FigureCanvasSVG(figure)
        grid = figure.subplots(len(panels), sharex=True, squeeze=False, height_ratios=list(panels))
        done = Drawing(figure, tuple(grid[:, 0]))
        yield done
        # Fixed margins: pictures side by side line up.
        left, right, named, unnamed, top = MARGINS
        bottom = named if done.panels[-1].get_xlabel() else unnamed
        figure.subplots_adjust(left / width, bottom / height, 1 - right / width, 1 - top / height, hspace=0.08)
        for axes in done.panels:
            axes.yaxis.set_label_coords(0.15 / width, 0.5, transform=_beside(figure, axes))
        buffer = io.BytesIO()
        canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})
        done.svg = themed(buffer.getvalue().decode())


def _beside(figure: Any, axes: Any) -> Any:
    """Horizontally the figure's fractions, vertically the panel's."""
    from matplotlib.transforms import blended_transform_factory

    return blended_transform_factory(figure.transFigure, axes.transAxes)


def themed(svg: str) -> bytes:
    """An SVG with the page's colours and font, sized by its viewBox, without what would leak into the page."""
    for pattern in (r"<\?xml.*?\?>", r"<!DOCTYPE.*?>", r"<metadata>.*?</metadata>", r"<style.*?</style>"):
        svg = re.sub(pattern, "", svg, flags=re.DOTALL)
    for colour, variable in _VARIABLES.items():
        svg = svg.replace(colour, f"var({variable})")
    svg = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1", svg)
    svg = re.sub(r" font-family: [^;\"]*;", "", svg)
    svg = re.sub(r' transform="rotate\(-?0 [^"]*\)"', "", svg)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    return re.sub(r"\n\s*", "\n", svg).strip().encode()
