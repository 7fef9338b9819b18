"""The tests of the split `light`: sequences in simulated light, as `placerec relight` writes them.

They lie in the experiment's cache, relit/KEY/NAME/.
"""

from dataclasses import dataclass
from pathlib import Path

from placerec.errors import ExperimentError
from placerec.experiments.store import images_of, key_of
from placerec.files import whole_folder
from placerec.frames import Sequence as FrameSequence
from placerec.vision.light import relight_sequence, relit_sequence

# One draw for all maps of an experiment, so that these alone are what varies.
SEED = 0


@dataclass(frozen=True)
class RelitJob:
    """A sequence that is to be seen in a simulated light; `cache`: the folder where it is kept."""

    sequence: FrameSequence
    light: str
    cache: Path


def relight_kept(job: RelitJob) -> FrameSequence:
    """The sequence in the light of a job, which is written unless it is there.

    Raises ExperimentError if none of its images can be read.
    """
    sequence = job.sequence
    frames = [(frame.name, repr(frame.time), frame.place) for frame in sequence.frames]
    key = key_of("relit", job.light, SEED, sequence.name, frames, images_of(sequence))
    folder = job.cache / "relit" / key / sequence.name
    if not folder.exists():
        with whole_folder(folder, ()) as made:
            if not any([*relight_sequence(sequence, made, job.light, seed=SEED)]):
                raise ExperimentError(f"{sequence.source}: none of its images can be read; leave the sequence out")
    return relit_sequence(sequence, folder)
