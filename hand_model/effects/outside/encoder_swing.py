"""The same of the segment that the encoder drives."""

from __future__ import annotations

from .segment_swing import SegmentSwing


class EncoderSwing(SegmentSwing):
    """angle = map(encoder) - A slope a."""

    name = "encoder_swing"
    station = "encoder"


EFFECT = EncoderSwing()
