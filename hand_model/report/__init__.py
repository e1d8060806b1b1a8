"""Pages and pictures. `write_report` makes the page of a replay; other pages use `page`, `Section` and `drawing`."""

from .page import Section, page
from .replay_report import OUTPUTS, replay_figures, replay_page, write_report

__all__ = ["OUTPUTS", "Section", "page", "replay_figures", "replay_page", "write_report"]
