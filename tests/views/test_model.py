# SPDX-License-Identifier: Apache-2.0
"""View data: what a document says is what is shown, and what it leaves out is left out."""

import example
import pytest
from driveid.views import model as view
from driveid.views import pieces


@pytest.mark.parametrize(("document", "kind"), [(example.explain(), "explain"), (example.compare(), "compare"), (example.improve(), "improve"), (example._common([]), "fit")])
def test_kind_of_document(document, kind):
    assert view.document(document).kind == kind


@pytest.mark.parametrize(("verdict", "words"), [
    ("missing", "An effect is missing"), ("nothing_missing", "Nothing is missing"), ("cannot_tell", "cannot tell"), ("unknown", "catalogue does not know"), ("bad_data", "cannot answer")])
def test_every_verdict_has_a_headline_and_advice(verdict, words):
    answer = view.document(example.explain(verdict)).answer
    assert words in answer.headline
    assert answer.sentence and answer.advice


def test_tie_names_both_and_stands_once():
    answer = view.document(example.explain("cannot_tell")).answer
    assert [c.effect for c in answer.accepted] == ["coulomb"]
    assert answer.accepted[0].ties == ["stribeck"]
    assert "stribeck friction" in answer.sentence.lower()


def test_unknown_shows_its_shape():
    shape = view.document(example.explain("unknown")).answer.shape
    assert shape.coordinates == ["theta_rad"] and len(shape.table) == 40
    assert "svg" in pieces.shape(shape)


def test_errors_keep_value_unit_floor():
    doc = view.document(example.compare())
    errors = dict(doc.errors)["held_out.csv"].by_kind
    assert errors["equation"].rmse == 0.0113 and errors["equation"].floor == (2.6e-4, 3.1e-4)
    assert errors["equation"].times_floor == pytest.approx(0.0113 / 3.1e-4)
    assert {r.role for r in doc.records} == {"training", "held out"}


def test_steps_begin_with_the_model_as_it_came():
    steps = view.document(example.improve()).steps
    assert [s.effect for s in steps] == ["", "coulomb"]
    assert steps[0].held_out.by_kind["equation"].rmse > steps[1].held_out.by_kind["equation"].rmse
    assert pieces.staircase(steps).count('class="held"') == 2


def test_regimes_fall_by_share():
    regimes = view.document(example.explain()).regimes
    assert [(r.axis, r.significant) for r in regimes] == [("direction", True), ("speed", True), ("acceleration", False)]  # chance comes last


@pytest.mark.parametrize("document", [{}, {"records": None, "ranked": None, "verdict": "missing"}, {"model": 'format = 1\nstructure = "lti"\n', "steps": [{}]},
                                      {"verdict": "brand_new", "ranked": [{}], "where": {}, "shape": {"table": [[1]]}, "next_record": {"motion": {"words": "turn"}}}])
def test_sparse_documents_are_shown_without_a_guess(document):
    doc = view.document(document)
    assert doc.parameters == []


def test_own_effect_and_model_text():
    doc = view.document({"model": 'format = 1\nstructure = "rigid_axis"\n[[effect]]\nname = "my_drag"\nformula = "c*omega_rad_s"\nparameters.c = { value = 2.0 }\n'})
    assert doc.model.effects == ["my_drag"] and doc.model.formulas == {"my_drag": "c*omega_rad_s"}
    assert doc.parameters[0].effect == "my_drag"
