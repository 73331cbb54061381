# SPDX-License-Identifier: Apache-2.0
"""What was added to a model, as it stands in an address."""

import pytest
from driveid import Model, UsageError
from driveid.views.workbench import chain


def test_orders_of_an_effect_are_counted():
    assert chain.orders(["N", "A_Nm", "phi_rad"]) == 1
    assert chain.orders(["N", "A_Nm", "phi_rad", "N_2", "A_Nm_2", "phi_rad_2", "N_3", "A_Nm_3", "phi_rad_3"]) == 3
    assert chain.orders(["J_kgm2", "x_2"]) == 1  # no x beside it
    assert chain.orders([]) == 1


def test_own_effect_survives_the_address():
    element = chain.own("my_drag", "c * max(omega_rad_s, 0)", "tau_Nm")
    assert "," not in element and chain.parse(f"coulomb,{element}") == ("coulomb", element)
    model = chain.add(chain.add(Model.new("rigid_axis", K_t_Nm_A=0.05), "coulomb"), element)
    assert [(e.name, e.formula, e.adds_to) for e in model.effects] == [("coulomb", "", ""), ("my_drag", "c * max(omega_rad_s, 0)", "tau_Nm")]
    assert list(model.effects[1].parameters) == ["c"]


def test_titles_number_what_stands_twice():
    assert chain.titles(("coulomb", "cogging", "cogging", "my_drag:tau_Nm:c")) == ["Coulomb friction", "cogging", "cogging (2)", "my drag"]


@pytest.mark.parametrize(("name", "formula", "words"), [("coulomb", "c", "catalogue"), ("mine", "c * (", "column"), ("", "c", "characters"), ("mine", "", ""), ('m"]', "c", "")])
def test_a_bad_own_effect_is_refused_in_words(name, formula, words):
    model = Model.new("rigid_axis", K_t_Nm_A=0.05)
    try:
        added = model.add_own(name, formula, "tau_Nm")
    except UsageError as error:
        assert words in str(error) and "line" not in str(error)
    else:
        assert not words and [e.name for e in added.effects] == [name]
