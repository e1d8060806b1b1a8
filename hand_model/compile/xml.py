"""XML with all digits and the same bytes for the same input."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def number(value: float) -> str:
    """Shortest text that reads back as the same double; never a negative zero."""
    return repr(float(value) + 0.0).removesuffix(".0")


def vector(values: ArrayLike) -> str:
    """Numbers (...) separated by blanks."""
    return " ".join(number(v) for v in np.ravel(values))


def child(parent: Any, tag: str, **attributes: Any) -> Any:
    """Append an element; floats and arrays keep all their digits, None is left out, a trailing underscore of a key is
    dropped."""
    from lxml import etree

    element = etree.SubElement(parent, tag)
    for key, value in attributes.items():
        if value is None:
            continue
        if isinstance(value, bool):
            text = "true" if value else "false"
        else:
            text = value if isinstance(value, str) else vector(value)
        element.set(key.rstrip("_"), text)
    return element


def comment(parent: Any, text: str) -> None:
    """Append a comment."""
    from lxml import etree

    parent.append(etree.Comment(f" {text.replace('--', '-')} "))


def document(root: Any) -> bytes:
    """The file's bytes, indented."""
    from lxml import etree

    etree.indent(root, "  ")
    return etree.tostring(root, xml_declaration=False, encoding="utf-8", pretty_print=True)
