"""A page of sections, each opening with its conclusion. HTML by lxml, one file, no outside resources, the same bytes
for the same input.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from lxml import etree, html
from lxml.html import builder as E

Element = Any  # lxml has no public element type


@dataclass(frozen=True)
class Section:
    """One section. name: its anchor. conclusion: one sentence in words with its figures. body: elements that support
    it.
    """

    name: str
    title: str
    conclusion: str
    body: tuple[Element, ...] = ()


@dataclass(frozen=True)
class Cell:
    """A table cell with a look of its own: kind is any of "dim", "best", "flag", "fine", "text", "wrap"."""

    text: str
    kind: str = ""


def page(title: str, lead: str, tiles: Sequence[tuple[str, str]], sections: Sequence[Section]) -> bytes:
    """The whole page as UTF-8. tiles: (figure, what it is) pairs shown on top."""
    style = resources.files(__package__).joinpath("style.css").read_text()
    head = E.HEAD(
        E.META(charset="utf-8"),
        E.META(name="viewport", content="width=device-width, initial-scale=1"),
        E.META(name="color-scheme", content="light dark"),
        E.TITLE(title),
        E.STYLE(style),
    )
    body = E.BODY(E.H1(title), E.P(lead, E.CLASS("lead")))
    if tiles:
        body.append(
            E.DIV(E.CLASS("tiles"), *[E.DIV(E.CLASS("tile"), E.B(figure), E.SPAN(what)) for figure, what in tiles])
        )
    if len(sections) > 1:
        body.append(E.E.nav(*[E.A(s.title, href=f"#{s.name}") for s in sections]))
    for section in sections:
        parts = (E.H2(section.title), E.P(section.conclusion, E.CLASS("conclusion")), *section.body)
        body.append(E.E.section(*parts, id=section.name))
    text = html.tostring(E.HTML(head, body, lang="en"), doctype="<!DOCTYPE html>", encoding="unicode", method="html")
    return (text + "\n").encode()


def table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str | Cell]],
    caption: str = "",
    groups: Sequence[tuple[str, int]] = (),
    text_columns: int = 1,
) -> Element:
    """A table that scrolls sideways where it is wider than the page. groups: (heading, columns spanned) above the
    columns.

    text_columns: how many columns from the left are words, aligned left.
    """
    head = E.THEAD()
    if groups:
        head.append(E.TR(*[E.TH(name, E.CLASS("group" if name else ""), colspan=str(span)) for name, span in groups]))
    head.append(E.TR(*[E.TH(name, *_class("text" if i < text_columns else "")) for i, name in enumerate(columns)]))
    body = E.TBODY(*[E.TR(*[_cell(value, i < text_columns) for i, value in enumerate(row)]) for row in rows])
    parts = ([E.CAPTION(caption)] if caption else []) + [head, body]
    return E.DIV(E.CLASS("scroll"), E.TABLE(*parts))


def figures(*drawn: tuple[str, bytes]) -> Element:
    """Pictures side by side as the width allows: (caption, SVG) pairs."""
    return E.DIV(
        E.CLASS("figures"), *[E.E.figure(E.E.figcaption(caption), etree.fromstring(svg)) for caption, svg in drawn]
    )


def key(*entries: tuple[str, str]) -> Element:
    """A legend: (CSS colour variable such as "c1", what it stands for) pairs."""
    return E.DIV(E.CLASS("key"), *[E.SPAN(E.I(style=f"background: var(--{colour})"), text) for colour, text in entries])


def heading(text: str) -> Element:
    """A heading within a section."""
    return E.H3(text)


def note(text: str) -> Element:
    """A small explanation below a table or picture."""
    return E.P(text, E.CLASS("note"))


def listing(items: Sequence[str]) -> Element:
    """A bulleted list."""
    return E.UL(*[E.LI(item) for item in items])


def folded(summary: str, *body: Element) -> Element:
    """Details that open on demand."""
    return E.E.details(E.E.summary(summary), *body)


def _class(kind: str) -> tuple[Any, ...]:
    return (E.CLASS(kind),) if kind else ()


def _cell(value: str | Cell, text: bool) -> Element:
    cell = value if isinstance(value, Cell) else Cell(value)
    return E.TD(cell.text, *_class(" ".join(filter(None, ["text" if text else "", cell.kind]))))
