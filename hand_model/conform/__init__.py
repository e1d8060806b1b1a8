"""Two descriptions of one hand against each other: do they move alike, and if not, where, by how much and why."""

from .check import conform, main_check, read
from .report import CAUSES, ConformReport, Finding

__all__ = ["CAUSES", "ConformReport", "Finding", "conform", "main_check", "read"]
