"""Names and settings give models; what does not belong to a model is refused."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.wake import GaussianJet, ImpingingJet, PaperJet, PowerJet, RoundJet, WakeSettings, model_names, wake_model
from wakewise.wake.learned import LearnedWake
from wakewise.wake.models import OWN_MODELS

AREA = np.pi * 0.03**2


def test_names_give_models_and_a_wrong_name_is_told_the_right_ones():
    """Each name gives a model of that name; any other is refused with the list."""
    assert model_names() == ("paper", "paper-calibrated", "fitted", "linear", "jet", "jet-fitted", "learned")
    assert [wake_model(name).name for name in model_names()] == list(model_names())
    assert [type(wake_model(name)) for name in model_names()] == [
        PaperJet, PowerJet, PowerJet, PowerJet, RoundJet, GaussianJet, LearnedWake,
    ]  # fmt: skip
    with pytest.raises(
        InputError, match="'swirl': unknown, allowed: paper, paper-calibrated, fitted, linear, jet, jet-fitted, learned"
    ):
        wake_model("swirl")


@pytest.mark.parametrize("name", OWN_MODELS)
def test_settings_without_numbers_are_the_named_model(name):
    """Defaults in settings and by name are the same model."""
    assert wake_model(WakeSettings(model=name, floor=False)) == wake_model(name)


def test_settings_carry_numbers():
    """A fit goes into a scenario file: its numbers replace the defaults, the rest stays."""
    fitted = wake_model(WakeSettings(model="fitted", cosine_power=80.0, floor=False))
    assert (fitted.gain, fitted.cosine_power, fitted.decay_power) == (0.6, 80.0, 0.85)
    assert wake_model(WakeSettings(model="jet-fitted", decay=5.0, floor=False)).decay == 5.0
    assert wake_model(WakeSettings(model="jet", half_width_slope=0.18, floor=False)).half_width_slope == 0.18
    smooth = wake_model(WakeSettings(model="paper", edge_width_deg=3.0, floor=False))
    assert (smooth.name, smooth.edge_width_rad, smooth.gain) == ("paper", pytest.approx(np.deg2rad(3.0)), 1.0)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"model": "paper", "gain": 0.5}, "wake model paper has no gain, allowed: edge_width_deg"),
        ({"model": "paper-calibrated", "decay_power": 1.0}, "has no decay_power, allowed: gain, edge_width_deg"),
        ({"model": "jet", "edge_width_deg": 3.0}, "wake model jet has no edge_width_deg, allowed: half_width_slope"),
        ({"model": "swirl"}, "'swirl': unknown, allowed: paper"),
        ({"model": "fitted", "gain": -1.0}, "greater than 0"),
        ({"model": "fitted", "twist": 1.0}, "Extra inputs"),
    ],
)
def test_a_number_that_a_model_does_not_have_is_refused(numbers, message):
    """`paper` is frozen, and no number is taken silently."""
    with pytest.raises(ValidationError, match=message):
        WakeSettings(**numbers)


def test_a_floor_needs_a_bed():
    """With `floor` the model is the jet and its wall jet; without a bed's depth it is refused."""
    model = wake_model(WakeSettings(model="fitted"), bed_z_m=1.5)
    assert isinstance(model, ImpingingJet)
    assert (model.name, model.bed_z_m, model.jet.name) == ("fitted+floor", 1.5, "fitted")
    with pytest.raises(InputError, match="floor is set but there is no bed"):
        wake_model(WakeSettings())


def test_the_default_levels_agree_where_they_say_so():
    """`linear` equals `fitted` on the axis at 0.3 m; a propeller's jet is within a third of both there."""
    fitted, linear, propeller = (
        float(model.speed(0.3, 0.0, 1.0, AREA))
        for model in (wake_model("fitted"), wake_model("linear"), RoundJet.of_propeller())
    )
    assert linear == pytest.approx(fitted, rel=0.01)
    assert propeller == pytest.approx(fitted, rel=1 / 3)
