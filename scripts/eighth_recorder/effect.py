"""One hidden effect: a name, its draw, and the stages of a recording into which it may reach."""

JOINTS = ("proximal", "distal")


class Effect:
    """Subclasses override `draw` and the stages they need; p is what `draw` returned."""

    name = ""
    part = "current"  # current | segments | log | markers | palm
    clashes: tuple[str, ...] = ()
    alone = False  # never a background effect

    def draw(self, rng, strength, finger, hand) -> dict:
        raise NotImplementedError

    def motor(self, p, run):
        """Before the simulation: run.constants (loads.h) and run.inputs (1 ms grid)."""

    def output(self, p, run):
        """run.output: the encoder position [%] that the proximal segment follows."""

    def angles(self, p, run):
        """run.proximal and run.distal [rad], run.tilt and run.shift, all on the 1 ms grid."""

    def log(self, p, run):
        """run.rows: log columns at run.rows['time'] (true time), before noise is added."""

    def lines(self, p, run):
        """run.rows after noise and rounding: what is done to the written table."""

    def local(self, p, run):
        """run.local: markers in their segments' frames, [palm, proximal, distal], each (frames, 3, 3)."""

    def labelled(self, p, run):
        """run.points: the written markers (frames, 9, 3)."""


def law_of(rng, *laws):
    """Choose among (name, weight)."""
    names, weights = zip(*laws, strict=True)
    total = sum(weights)
    return str(rng.choice(names, p=[w / total for w in weights]))


def either(rng):
    """A random sign."""
    return float(rng.choice([-1.0, 1.0]))
