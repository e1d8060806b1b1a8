"""What is wrong with a rig's channels, as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..diagnose.findings import Finding
from .channels import ChannelIssue
from .clipping import limits
from .declared import DeclaredFit
from .findings import whereabouts
from .model import RigModel

UNMEASURED = {
    "metric": None,
    "unit": None,
    "before": None,
    "after": None,
    "noise_floor": None,
    "ci95_reduction": None,
    "held_out": [],
    "engine": None,
}


def channel_findings(rig: RigModel, fit: DeclaredFit, issues: Sequence[ChannelIssue]) -> list[Finding]:
    """A finding of each issue. rig: as recorded, clipped samples included; fit: of the declared model, without what is
    refused or clipped."""
    return [_finding(i, _share(rig, fit, i)) for i in issues]


def _finding(issue: ChannelIssue, share: float) -> Finding:
    action = (
        "it is refused, nothing is fitted to it" if issue.refuse else "samples there say only that it is at least that"
    )
    return Finding(
        issue.kind,
        (issue.kind,),
        1.0,
        (),
        whereabouts(issue.joint, None, issue.channel, issue.trials, share),
        f"{issue.reason}: {action}.",
        {"share_left": {"value": issue.share, "unit": "1"}},
        UNMEASURED,
        None,
        "channel refused" if issue.refuse else "channel clipped",
    )


def _share(rig: RigModel, fit: DeclaredFit, issue: ChannelIssue) -> float:
    """Share of the mismatch that a channel's issue holds: all of it where the channel is refused; of clipped samples
    what the declared model, fitted to the others, asks for beyond the limits."""
    if issue.refuse:
        return 1.0
    effort = {t.name: t for t in rig.trials if issue.joint in t.effort}
    cut, left = 0.0, 0.0
    for row in (r for r in fit.rows if r.joint == issue.joint and r.trial in effort):
        values, (low, high) = effort[row.trial].effort[row.joint], limits(effort[row.trial], row.joint)
        at = np.interp(row.time_s, effort[row.trial].time_s, np.isin(values, (low, high)).astype(float)) > 0.5
        asked = fit.expected(row)
        cut += float(np.sum(np.square(np.maximum(asked - high, 0.0) + np.minimum(asked - low, 0.0))[at]))
        left += float(np.sum(fit.residual(row)[row.moving] ** 2)) * row.step
    return cut / max(cut + left, 1e-300)
