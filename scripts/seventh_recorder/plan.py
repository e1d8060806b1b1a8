"""What is hidden in one finger's recordings: filled by the effects, read by the recorder's stations."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .hand import Finger
from .stepper import TABLE_Q, TABLE_SIZE, Run

NOISE = {"counts": 4.0, "current": 4.9, "marker_mm": 0.15}  # as measured


@dataclass
class LogTable:
    """A log before noise is rounded away: time on the true clock (s), counts, raw current, commands."""

    time: np.ndarray
    counts: np.ndarray
    current: np.ndarray
    run: Run
    reference: np.ndarray


AngleChange = Callable[[np.ndarray, Run], np.ndarray]
MarkerChange = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
LogChange = Callable[[LogTable, np.random.Generator], None]


@dataclass
class Plan:
    """Everything hidden in one finger.

    ``finger_steps`` turn the finger-side position (%), ``proximal_steps`` the coupling's input (rad), ``distal_steps``
    the distal angle (rad); ``wobbles`` and ``shifts`` are per joint; ``marker_steps`` act on (frames, 6, 3) mm in the
    palm frame, ``palm_steps`` on (frames, 3, 3); ``frame_steps`` on the nine finished markers; ``log_steps`` on a log.
    """

    finger: Finger
    noise: dict[str, float]
    up_palm: np.ndarray
    drive: dict[str, float] = field(default_factory=dict)
    load_table: np.ndarray = field(default_factory=lambda: np.zeros(TABLE_SIZE))
    friction_table: np.ndarray = field(default_factory=lambda: np.zeros(TABLE_SIZE))
    command_delay: Callable[[np.random.Generator], float] = lambda rng: 0.0
    position_delay: float = 0.0
    current_delay: float = 0.0
    current_clip: float = np.inf
    clock: Callable[[np.ndarray], np.ndarray] = lambda t: t
    random_load: float = 0.0
    touch_trials: tuple[str, ...] = ()
    cools_between: bool = False
    finger_steps: list[AngleChange] = field(default_factory=list)
    proximal_steps: list[AngleChange] = field(default_factory=list)
    distal_steps: list[AngleChange] = field(default_factory=list)
    wobbles: list[tuple[int, AngleChange]] = field(default_factory=list)
    shifts: list[tuple[int, Callable[[np.ndarray], np.ndarray]]] = field(default_factory=list)
    marker_steps: list[MarkerChange] = field(default_factory=list)
    palm_steps: list[MarkerChange] = field(default_factory=list)
    frame_steps: list[Callable[[np.ndarray, np.random.Generator], np.ndarray]] = field(default_factory=list)
    log_steps: list[LogChange] = field(default_factory=list)
    replace_log: LogChange | None = None

    def scalar(self, name: str) -> float:
        """A motor parameter of this finger, as planned so far."""
        return self.drive.get(name, self.finger.motor[name])

    def add(self, name: str, value: float) -> None:
        """Add to a scalar of the drive that is zero when nothing is hidden."""
        self.drive[name] = self.drive.get(name, 0.0) + value

    def add_load(self, shape: Callable[[np.ndarray], np.ndarray]) -> None:
        """Add a load (raw units) that is a function of position in %."""
        self.load_table = self.load_table + shape(TABLE_Q)

    def add_friction(self, shape: Callable[[np.ndarray], np.ndarray]) -> None:
        """Add to the Coulomb level (raw units) a function of position in %."""
        self.friction_table = self.friction_table + shape(TABLE_Q)
