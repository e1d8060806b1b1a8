"""Break a session's manifest, and read the one line by which it is refused."""

from __future__ import annotations

import pytest

from hand_model.errors import SessionError


def edit(root, old, new, count=1):
    """Replace text in the manifest; the text must be there."""
    file = root / "session.toml"
    text = file.read_text()
    assert old in text, old
    file.write_text(text.replace(old, new, count))


def refusal(call, *args):
    """The message of the SessionError that a call raises: one line."""
    with pytest.raises(SessionError) as caught:
        call(*args)
    message = str(caught.value)
    assert type(caught.value) is SessionError and "\n" not in message
    return message
