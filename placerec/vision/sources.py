"""The whole way from image sources to a file: what `placerec describe` and `placerec train-words` do."""

import logging
from collections.abc import Iterable
from pathlib import Path

from placerec.files import whole_file
from placerec.frames import find_sequences
from placerec.vision.describe import Progress, describe, save_descriptors
from placerec.vision.dictionary import Dictionary
from placerec.vision.spec import DescriptorSpec

log = logging.getLogger(__name__)


def describe_sources(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    format: str = "auto",
    progress: Progress | None = None,
) -> None:
    """Write the descriptors of all frames of the sources to `out`; `progress` is called with frames done and in all.

    `spec`, `matrix`: as for `describe`. Raises SourceError for sources and VisionError for images or a matrix that
    cannot be used, OutputError for the file.
    """
    # The file comes first: that it cannot be written must not be found out after an hour of images.
    with whole_file(Path(out)) as partial:
        save_descriptors(
            describe(find_sequences(sources, format=format), spec, matrix=matrix, progress=progress), partial
        )


def train_dictionary(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    format: str = "auto",
    size: int = 10,
    components: int = 80,
    seed: int = 0,
    fraction: float = 1.0,
    epochs: int | None = None,
    units: str = "live",
    progress: Progress | None = None,
) -> Dictionary:
    """Describe the frames of the sources, fit a dictionary to them (`Dictionary.fit`) and write it to `out`.

    `spec`, `matrix`: as for `describe`. `progress` is called with frames described and in all. Raises as
    `describe_sources` and `Dictionary.fit` do.
    """
    with whole_file(Path(out)) as partial:
        described = describe(find_sequences(sources, format=format), spec, matrix=matrix, progress=progress)
        dictionary = Dictionary.fit(
            described.values,
            spec=described.spec,
            size=size,
            components=components,
            seed=seed,
            fraction=fraction,
            epochs=epochs,
            units=units,
        )
        dictionary.save(partial)
    _report(dictionary)
    return dictionary


def _report(dictionary: Dictionary) -> None:
    quality = dictionary.quality
    log.info(
        "%d words, %d of them never seen, from %d of %d frames; %d components keep %.1f %% of the variance (%d would "
        "keep 99 %%); quantisation error %.4g, topographic error %.3f after %d epochs",
        len(dictionary.hits),
        dictionary.dead,
        quality.used,
        quality.frames,
        len(dictionary.pca.components),
        100 * quality.explained,
        quality.needed,
        quality.quantisation_error,
        quality.topographic_error,
        quality.epochs,
    )
