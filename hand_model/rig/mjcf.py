"""The rig's MJCF as a tree, and what it keeps as JSON in `custom/text[@name="hand_model"]`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import DescriptionError

TEXT = "hand_model"


def parse(xml: bytes) -> Any:
    """The MJCF tree, comments kept."""
    from lxml import etree

    try:
        return etree.fromstring(xml)
    except etree.XMLSyntaxError as error:
        raise DescriptionError(f"the rig's MJCF is not XML: {error}") from None


def serialise(root: Any) -> bytes:
    """The tree as bytes, the same for the same tree."""
    from lxml import etree

    return etree.tostring(root, encoding="utf-8", xml_declaration=False) + b"\n"


def number(*values: float) -> str:
    """Numbers with all their digits, blank between."""
    return " ".join(repr(float(v)) for v in values)


def find(root: Any, tag: str, name: str) -> Any:
    """The element <tag name="name">; raises DescriptionError where there is none."""
    for element in root.iter(tag):
        if element.get("name") == name:
            return element
    raise DescriptionError(f'the rig\'s MJCF has no {tag} "{name}"')


def write_effects(xml: bytes, effects: Sequence[Mapping[str, Any]]) -> bytes:
    """The MJCF with effects that have no attribute kept as JSON in custom/text; [] removes them."""
    root = parse(xml)
    for section in root.findall("custom"):
        for text in [t for t in section.findall("text") if t.get("name") == TEXT]:
            section.remove(text)
        if not len(section):
            root.remove(section)
    if effects:
        from lxml import etree

        section = etree.SubElement(root, "custom")
        etree.SubElement(section, "text", name=TEXT, data=json.dumps(list(effects), sort_keys=True))
    return serialise(root)


def read_effects(xml: bytes) -> list[dict[str, Any]]:
    """Effects at joints that `write_effects` kept in an MJCF."""
    return [record for record in _records(xml) if "coupling" not in record]


def keep_couplings(xml: bytes, records: Sequence[Mapping[str, Any]]) -> bytes:
    """The MJCF with what its couplings lack, each record with the name of its "coupling", beside its effects at
    joints."""
    return write_effects(xml, [*read_effects(xml), *records])


def read_couplings(xml: bytes) -> list[dict[str, Any]]:
    """What `keep_couplings` kept in an MJCF."""
    return [record for record in _records(xml) if "coupling" in record]


def _records(xml: bytes) -> list[dict[str, Any]]:
    for text in parse(xml).iter("text"):
        if text.get("name") == TEXT:
            return json.loads(text.get("data"))
    return []
