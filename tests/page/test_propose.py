"""Labels that a model proposes, and where to look at them first."""

import shutil
import threading
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images
from helpers.typed_commands import make_words
from helpers.waiting import wait_until

from placerec.errors import ModelError
from placerec.frames import find_sequences
from placerec.page.propose import Proposal, Proposer, learn_from, look_first
from placerec.vision import describe


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("propose")
    make_words(root)
    shutil.copytree(root / "seen-model", root / "model")
    shutil.copy(root / "words.npz", root / "model")
    return root


def test_contradictions_come_first_and_then_the_least_sure() -> None:
    proposal = Proposal(("a", "a", "b", "b", "b", "a", "a"), np.array([0.1, 0.1, 0.6, 0.4, 0.2, 0.3, 0.3]))
    looks = look_first(proposal, ["a", "", "", "a", "a", "b", ""])
    assert [(look.start, look.end, look.place, look.label) for look in looks] == [
        *((3, 5, "b", "a"), (5, 6, "a", "b")),
        *((2, 3, "b", ""), (6, 7, "a", ""), (1, 2, "a", "")),
    ]
    assert [look.doubt for look in looks] == pytest.approx([0.3, 0.3, 0.6, 0.3, 0.1])
    assert look_first(proposal, proposal.places) == []


def finished(proposer: Proposer) -> None:
    wait_until(lambda: not proposer.busy, "the proposals never come")


def test_a_model_proposes_and_what_cannot_be_read_is_where_the_frame_before_is(world: Path, tmp_path: Path) -> None:
    folder = write_images(tmp_path / "seq", 1)
    broken = sorted((folder / "std_cam").iterdir())[4]
    broken.write_bytes(b"no picture")
    sequences = find_sequences([folder])
    proposer = Proposer(sequences, world / "model")
    assert (proposer.places, proposer.round, proposer.proposals) == (["hall", "kitchen"], 0, None)
    assert proposer.start()
    finished(proposer)
    assert (proposer.round, proposer.said) == (1, f"proposed by {world / 'model'}")
    assert proposer.proposals is not None
    (proposal,) = proposer.proposals
    assert len(proposal.places) == len(proposal.doubt) == 12
    assert proposal.places[4] == proposal.places[3]
    assert ((proposal.doubt >= 0) & (proposal.doubt <= 1)).all()
    right = np.mean([one == other for one, other in zip(proposal.places, ["hall"] * 6 + ["kitchen"] * 6, strict=True)])
    assert right > 0.7


def test_labels_teach_a_model_that_proposes_for_the_rest(world: Path) -> None:
    sequences = find_sequences([world / "runs"])
    proposer = Proposer(sequences, world / "model")
    assert proposer.start(lambda: [["attic"] * 6 + ["cellar"] * 6, [""] * 12])
    assert not proposer.start()
    finished(proposer)
    assert (proposer.round, proposer.said) == (1, "proposed by what 1 labelled drives teach")
    assert proposer.proposals is not None
    assert {*proposer.proposals[1].places} == {"attic", "cellar"}
    # The user's own model stays as it is.
    assert Proposer(sequences, world / "model").places == ["hall", "kitchen"]


def test_what_teaches_nothing_is_said(world: Path, tmp_path: Path) -> None:
    sequences = find_sequences([world / "runs"])
    with pytest.raises(ModelError, match="a model of one place proposes nothing else; label two places at least"):
        learn_from([describe(sequences[:1])], [["attic"] * 12], tmp_path)
    proposer = Proposer(sequences, None)
    assert proposer.start(lambda: [[""] * 12, [""] * 12])
    finished(proposer)
    assert proposer.round == 0
    assert proposer.said == "no proposals: a model of one place proposes nothing else; label two places at least"
    with pytest.raises(ModelError, match="no such model folder"):
        Proposer(sequences, tmp_path / "nothing")
    assert not [thread for thread in threading.enumerate() if thread.name == "propose" and thread.is_alive()]
