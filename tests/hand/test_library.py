"""Which hand model a track's betas belong to."""

import pytest

from geneoh.errors import MissingAssetError
from geneoh.hand import library
from geneoh.hand.library import hand_of_betas, load_hand


@pytest.mark.parametrize(
    ("asked", "hand_model", "loaded"),
    [
        ("mano", "mano-as-shipped", "mano-as-shipped"),
        ("mano", "mano", "mano"),
        ("mano", "embedded", "mano"),
        ("embedded", "mano-as-shipped", "embedded"),
        ("mano-as-shipped", "mano", "mano-as-shipped"),
        (None, "mano-as-shipped", "mano-as-shipped"),
        (None, "mano", "mano"),
        (None, "embedded", "embedded"),
        (None, None, "embedded"),
    ],
)
def test_a_track_is_posed_by_the_model_that_its_betas_belong_to(
    asked, hand_model, loaded, monkeypatch
):
    calls, model = [], load_hand("left")

    def load(side, **said):
        calls.append((side, said))
        return model

    monkeypatch.setattr(library, "load_hand", load)
    assert hand_of_betas("left", hand_model, asked=asked, mano_dir="anywhere") is model
    assert calls == [("left", {"source": loaded, "mano_dir": "anywhere"})]


def test_without_a_mano_file_the_model_of_manos_betas_is_missed_and_not_replaced(tmp_path):
    with pytest.raises(MissingAssetError, match="MANO_LEFT"):
        hand_of_betas("left", "mano", mano_dir=tmp_path)
    assert hand_of_betas("left", "embedded", mano_dir=tmp_path) is load_hand("left")
