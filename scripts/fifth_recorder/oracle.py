"""How much a hidden thing shows: likelihood gain (nats) over the declared model refitted, from noise-free recordings.

All noise of this recorder is white, so that every row and every frame counts as an independent sample.
"""

from dataclasses import dataclass

import numpy as np

from fifth_recorder.plan import Frames, Plan, Rows, Trial
from fifth_recorder.simulate import AT, Happening, frame_times, happen, log_rows, palm_frames, row_times, turn
from fifth_recorder.stepper import DT

REGRESSORS = ("a", "v", "shadow", "x")  # motor columns of the declared current, besides a constant
SLIDES = 0.5  # %/s: the declared friction says nothing of a motor at rest


@dataclass
class Gain:
    """Nats by channel, and the number of samples that they come from."""

    current: float = 0.0
    angle: float = 0.0
    marker: float = 0.0
    drive: float = 0.0
    beside: float = 0.0  # known from another motor
    rows: int = 1
    frames: int = 1

    @property
    def total(self) -> float:
        """All channels together."""
        return self.current + self.angle + self.marker + self.drive + self.beside

    def error_increase(self) -> float:
        """Largest relative increase of a channel's error over its noise."""
        nats = np.array([self.current / self.rows, self.angle / (2 * self.frames), self.marker / (9 * self.frames)])
        return float(np.sqrt(1.0 + 2.0 * nats).max() - 1.0)


def _misfit(y: np.ndarray, regressors: np.ndarray) -> np.ndarray:
    scaled = regressors / np.maximum(np.linalg.norm(regressors, axis=0), 1e-12)
    return y - scaled @ np.linalg.lstsq(scaled, y, rcond=1e-10)[0]


def fit_turns(model: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and residuals (n, k, 3) of the rigid fit of model (k, 3) to points (n, k, 3)."""
    a, b = model - model.mean(0), points - points.mean(1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("ki,nkj->nij", a, b))
    d = np.ones((len(points), 3))
    d[:, 2] = np.linalg.det(u) * np.linalg.det(vt)
    r = np.einsum("nji,nj,nkj->nik", vt, d, u)
    return r, b - np.einsum("nij,kj->nki", r, a)


def _vector(r: np.ndarray) -> np.ndarray:
    w = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1) / 2
    sine = np.linalg.norm(w, axis=1)
    angle = np.arctan2(sine, (np.trace(r, axis1=1, axis2=2) - 1) / 2)
    return w * (angle / np.maximum(sine, 1e-9))[:, None]


def _sees(model: np.ndarray, sigma: float) -> np.ndarray:
    """Standard deviations (rad) of the three rotations that a marker triple shows, in its own frame's axes."""
    a = model - model.mean(0)
    return sigma * np.sqrt(np.diag(np.linalg.inv(np.eye(3) * (a**2).sum() - a.T @ a)))


def _read_position(rows: Rows, true: np.ndarray, t: np.ndarray, plan: Plan) -> np.ndarray:
    """Share of range that the log claims at mocap times, clocks aligned by one offset."""
    low, high = plan.finger.counts
    time = rows.time - np.mean(rows.time - true)
    return np.interp(t, time, (rows.position - low) / (high - low))


def _powers(s: np.ndarray, degree: int) -> np.ndarray:
    return np.stack([s**k for k in range(degree + 1)], axis=1)


@dataclass
class Hinge:
    """Angle (rad) of a joint by frame, its noise, and the squared misfit (over noise) of what no hinge does."""

    angle: np.ndarray
    noise: float
    misfit: float


def _hinge(w: np.ndarray, where: np.ndarray, noise: np.ndarray, sigma: float) -> Hinge:
    """The angle that both the turn w and the place of the next segment's markers (noise sigma) speak for."""
    axis = w[np.argmax(np.linalg.norm(w, axis=1))]
    axis = axis / np.linalg.norm(axis)
    spread = float(np.sqrt((axis**2) @ noise**2))
    q = own = w @ axis
    for _ in range(6):
        about = turn(axis, q)
        centre, arm = _arm(where, about)
        spoke = about @ arm
        along, off = np.cross(axis, spoke), where - centre - spoke
        sharp = (along**2).sum(1) / sigma**2 + 1.0 / spread**2
        q = q + ((along * off).sum(1) / sigma**2 + (own - q) / spread**2) / sharp
    about = turn(axis, q)
    centre, arm = _arm(where, about)
    misfit = float(((where - centre - about @ arm) ** 2).sum()) / sigma**2 + float(((own - q) ** 2).sum()) / spread**2
    across = w - own[:, None] * axis
    misfit += float(((_misfit(across, _powers(q, 4)) / noise) ** 2).sum())
    return Hinge(q, float(1.0 / np.sqrt(sharp.mean())), misfit)


def _arm(where: np.ndarray, about: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre and arm (3) of places (n, 3) turned by (n, 3, 3): least squares of where = centre + about arm."""
    n = len(where)
    mean = about.mean(0)
    square = np.block([[n * np.eye(3), n * mean], [n * mean.T, n * np.eye(3)]])
    right = np.concatenate([where.sum(0), np.einsum("nij,ni->j", about, where)])
    both = np.linalg.lstsq(square, right, rcond=1e-9)[0]
    return both[:3], both[3:]


def _body(plan: Plan, seen: list[tuple[Frames, np.ndarray]]) -> tuple[float, float, int]:
    sigma = plan.lab.marker_noise * 1e-3
    points = np.concatenate([frames.points for frames, _ in seen])
    s = np.concatenate([share for _, share in seen])
    triples = [points[:, 3 * k : 3 * k + 3] for k in range(3)]
    turns, rigid, middles, spread = [], 0.0, [], []
    for triple in triples:
        model = triple[0]
        for _ in range(2):
            r, off = fit_turns(model, triple)
            model = model + np.einsum("nji,nkj->nki", r, off).mean(0)
        off = fit_turns(model, triple)[1]
        rigid += float((off**2).sum()) / sigma**2
        turns.append(r)
        middles.append(triple.mean(1))
        spread.append(_sees(model, sigma))
    low, high = plan.finger.counts
    encoder = np.hypot(plan.lab.count_noise, 0.29) / (high - low) * plan.finger.full[0]
    nats, q = 0.0, None
    for k in (1, 2):
        base = turns[k - 1]
        w = _vector(np.einsum("nji,njk->nik", base, turns[k]))
        where = np.einsum("nji,nj->ni", base, middles[k] - middles[k - 1])
        noise = np.hypot(spread[k - 1], spread[k])
        reach = np.linalg.norm(where, axis=1).mean()
        hinge = _hinge(w, where, noise, np.hypot(sigma * np.sqrt(2.0 / 3.0), reach * spread[k - 1].mean()))
        rigid += hinge.misfit
        nats += float((_misfit(hinge.angle, _powers(s if q is None else q, 3 if q is None else 4)) ** 2).sum()) / (
            hinge.noise**2 + (encoder if k == 1 else 0.0) ** 2
        )
        q = hinge.angle
    return 0.5 * nats, 0.5 * rigid, len(points)


def _drive(plan: Plan, told: list[Happening], calm: list[Happening]) -> float:
    """Nats by when the middle of every move is passed, against the same motor unhindered."""
    nats, spread = 0.0, np.hypot(plan.lab.log_step / np.sqrt(12.0), 0.004)
    for a, b in zip(told, calm):
        here = 0.0
        for move in a.trial.moves:
            half, up = 0.5 * (here + move.target), move.target > here
            begin = int(move.at / DT)
            times = [np.argmax((q.signals.x[begin:] > half) == up) * DT for q in (a, b)]
            nats += 0.5 * ((times[0] - times[1]) / spread) ** 2
            here = move.target
    return float(nats)


def gain(plan: Plan, palm: np.ndarray, trials: list[Trial], calm: list[Happening], drive: bool, every: int = 3) -> Gain:
    """Gain of everything hidden in a plan, its markers looked at in one of `every` frames.

    `calm` are the healthy motor's trials; `drive` says whether following the command otherwise than there counts.
    """
    told = happen(plan, trials, calm)
    y, a, seen, n = [], [], [], 0
    for h in told:
        rows = log_rows(plan, h, noisy=False)
        true = row_times(plan, h.trial)
        t = true - h.signals.late
        c = np.stack([np.interp(t, h.signals.t, h.columns[:, AT[q]]) for q in REGRESSORS] + [np.ones(len(t))], axis=1)
        slides = np.abs(c[:, 1]) > SLIDES
        y.append(rows.current[slides])
        a.append(c[slides])
        n += len(t)
        if h.trial.kind == "flexion" and plan.acts_on_body():
            t = frame_times(plan, h.trial)
            frames = palm_frames(plan, palm, h, t[::every])
            for hook in plan.world:
                hook(frames)
            shown = np.arange(len(t))[::every] / plan.lab.mocap_rate
            seen.append((frames, _read_position(rows, true, shown, plan)))
    current = 0.5 * float(((_misfit(np.concatenate(y), np.concatenate(a)) / plan.lab.current_noise) ** 2).sum())
    angle, marker, frames_seen = _body(plan, seen) if seen else (0.0, 0.0, 1)
    followed = _drive(plan, told, calm) if drive else 0.0
    return Gain(current, every * angle, every * marker, followed, 0.0, n, every * frames_seen)
