"""Selection of effects: what stands beside a small term, and instead of a large one."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hand_model.diagnose.name import selection
from hand_model.diagnose.name.naming import Rival

LEFT = {0: 2000.0, 1: 60.0}  # what a fit without that term leaves more


@pytest.mark.parametrize(("rival", "together", "told"), [(1010.0, 995.0, "large"), (1040.0, 1000.0, "rival")])
def test_small_terms_stand_for_a_rival_only_if_it_explains_more_than_all_of_them_together(
    monkeypatch: pytest.MonkeyPatch, rival: float, together: float, told: str
) -> None:
    """The large term brings 1000 and the small one 25 beside it; a rival in the place of both brings as much as is
    given, and beside the small one `together`."""
    terms = tuple(SimpleNamespace(effect=SimpleNamespace(name=name)) for name in ("large", "small"))
    fit = SimpleNamespace(terms=terms, rss=1000.0, amplitudes=({}, {}))
    balance = SimpleNamespace(
        fit=lambda some: SimpleNamespace(rss=fit.rss + sum(v for i, v in LEFT.items() if terms[i] not in some))
    )

    def in_place(pair, effects, fit, which, others) -> list[Rival]:
        if which == 1:
            return [Rival("small", 25.0, fit)]
        other = together if 1 in others else rival
        return sorted([Rival("large", 1000.0, fit), Rival("rival", other, fit)], key=lambda r: -r.evidence)

    monkeypatch.setattr(selection, "_in_place", in_place)
    monkeypatch.setattr(selection, "evidence", lambda balance, fit, rest, which, scale: {0: 1000.0, 1: 25.0}[which])
    monkeypatch.setattr(selection, "scale_of", lambda *_: 1.0)
    monkeypatch.setattr(selection, "_size", lambda *_: 1.0)
    found = selection._findings(SimpleNamespace(state=balance), (), fit)
    assert [f.term.effect.name for f in found] == ["large", "small"]
    assert found[0].rivals[0].name == told
    assert (found[0].probability > 0.99) == (told == "large")
