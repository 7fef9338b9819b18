"""Peers of `compare` on other views: one descriptor, several joined, and all that `hohmm` sees."""

from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import write_images

from placerec.errors import EvaluationError
from placerec.experiments.comparison import views
from placerec.experiments.comparison.methods import DEFAULT, DESCRIPTORS, method_of
from placerec.experiments.comparison.run import check_methods, compare
from placerec.experiments.comparison.views import ALL, PLAIN, see
from placerec.experiments.store import WordsJob, describe_all
from placerec.frames import find_sequences
from placerec.vision import DescriptorSpec, DictionaryOptions, DictionarySet, DictionarySetOptions
from placerec.vision.pca import project

pytest.importorskip("sklearn")
pytest.importorskip("matplotlib")

KIND = "gist+lbp+ranks"
GIST = DescriptorSpec()


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("views") / "runs"
    for seed in range(4):
        write_images(folder / f"run{seed}", seed)
    return folder


@pytest.fixture(scope="module")
def job(runs: Path) -> WordsJob:
    """Three runs to learn from and one to test on, described by all kinds of the default."""
    cache = runs.parent / "cache"
    described = describe_all(find_sequences([runs]), DescriptorSpec(kind=KIND), cache)
    return WordsJob(tuple(described[:3]), tuple(described[3:]), DictionaryOptions(size=2), cache)


def default_views(job: WordsJob) -> DictionarySet:
    """The dictionaries that `learn` makes of the training sequences of a job."""
    found = [one.load() for one in job.train]
    values, labels = np.concatenate([one.values for one in found]), [p for one in found for p in one.table.places]
    return DictionarySet.fit(values, spec=found[0].spec, places=labels, options=DictionarySetOptions(sizes=(2,)))


def test_names_of_the_default_are_views_of_methods_of_descriptors() -> None:
    marked = [name for name in DEFAULT if method_of(name).view != PLAIN]
    assert {"torralba2003@pn-tuned", "knn@pn", "logistic@views", "ullah2008-hmm@views-tuned"} < {*marked}
    assert {method_of(name).kind for name in marked} == {DESCRIPTORS}
    assert {method_of(name).view for name in marked} == {"pn", ALL}
    assert method_of("rbf-svm-hmm@gist+lbp:pn-tuned").view == "gist+lbp:pn"
    assert check_methods(["knn@lbp", "knn", "hohmm", "knn@lbp"]) == ["hohmm", "knn", "knn@lbp"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "knn@tuned",
            "no method is called 'knn@tuned'; choose from hohmm, .*torralba2003 on also on a view: knn@lbp:pn",
        ),
        ("wu2009@pn", "no method is called 'wu2009@pn'"),
        ("hohmm@views", "no method is called 'hohmm@views'"),
        ("knn@", "no method is called 'knn@'"),
        ("rbf-svm@nose-tuned", "no method is called"),
        ("knn@nose", "knn@nose: no view is called 'nose'; choose some of plain, .*; views are all of hohmm together"),
        ("knn@lbp:white", "knn@lbp:white: 'lbp:white': no projection is called 'white'"),
    ],
)
def test_unknown_names_and_views_are_told_in_one_line(name: str, message: str) -> None:
    with pytest.raises(EvaluationError, match=message) as found:
        check_methods([name])
    assert "\n" not in str(found.value)


def test_views_are_those_of_the_dictionaries_of_hohmm(job: WordsJob) -> None:
    words = default_views(job)
    dictionary = words.dictionaries[0]
    assert [one.view for one in words.dictionaries] == ["gist", "gist:pn", "lbp:pn", "ranks:pn"]
    seen = see(["pn", "lbp:pn", "lbp", ALL], job, dictionary)
    assert list(seen) == [PLAIN, "pn", "lbp:pn", "lbp", ALL]
    found = [one.load() for one in (*job.train, *job.test)]
    blocks = {one.view: [project(each.part(one.spec).values, one.pca) for each in found] for one in words.dictionaries}
    for name, view in ((PLAIN, "gist"), ("pn", "gist:pn"), ("lbp:pn", "lbp:pn")):
        for points, expected in zip(seen[name].points, blocks[view], strict=True):
            np.testing.assert_array_equal(points, expected)
    for number, points in enumerate(seen[ALL].points):
        scaled = []
        for block in blocks.values():
            training = np.concatenate(block[:3]).astype(np.float64)
            scaled.append(block[number] / np.sqrt(np.square(training - training.mean(axis=0)).sum() / len(training)))
        np.testing.assert_allclose(points, np.concatenate(scaled, axis=1), rtol=1e-4, atol=1e-6)


def test_joined_views_and_half_whitening_are_fitted_as_dictionaries_are(job: WordsJob) -> None:
    found = [one.load() for one in (*job.train, *job.test)]
    values, labels = np.concatenate([one.values for one in found[:3]]), [p for o in found[:3] for p in o.table.places]
    names = ("gist+lbp", "gist+lbp:pn", "ranks:half")
    words = DictionarySet.fit(
        values, spec=found[0].spec, places=labels, options=DictionarySetOptions(views=("gist", *names), sizes=(2,))
    )
    seen = see(names, job, words.dictionaries[0])
    for name, one in zip((PLAIN, *names), words.dictionaries, strict=True):
        for points, each in zip(seen[name].points, found, strict=True):
            np.testing.assert_array_equal(points, project(each.part(one.spec).values, one.pca))


def test_what_more_descriptors_take_is_added_and_what_fewer_take_is_not(
    job: WordsJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs = {"gist": 100.0, "lbp": 30.0, KIND: 145.0}
    monkeypatch.setattr(views, "description_cost", lambda job, tests, spec: costs[spec.kind])
    seen = see(["pn", "lbp:pn", ALL], job, job.part(GIST).dictionary())
    assert {name: one.microseconds for name, one in seen.items()} == {PLAIN: 0, "pn": 0, "lbp:pn": 0, ALL: 45}


def test_methods_on_views_run_beside_the_others(job: WordsJob, runs: Path, tmp_path: Path) -> None:
    methods = ["knn", "knn@gist", "rbf-svm@pn", "rbf-svm@gist:pn", "knn@lbp+ranks:pn", "rbf-svm-hmm@views-tuned"]
    found = compare([runs], [runs / "run3"], tmp_path / "out", methods=methods, size=2, cache=job.cache)
    assert {score.method for score in found.scores} == {*methods}

    def beliefs(name: str) -> str:
        return (tmp_path / "out/beliefs" / name / "run3.tsv").read_text(encoding="utf-8")

    assert beliefs("knn") == beliefs("knn@gist") != beliefs("knn@lbp+ranks:pn")
    assert beliefs("rbf-svm@pn") == beliefs("rbf-svm@gist:pn") != beliefs("rbf-svm-hmm@views-tuned")
    best = {score.method: score.accuracy for score in found.scores}
    assert best["rbf-svm-hmm@views-tuned"] > 0.8


def test_views_of_own_words_are_theirs(job: WordsJob, runs: Path, tmp_path: Path) -> None:
    found = [one.load().part(DescriptorSpec(kind="gist+lbp")) for one in job.train]
    values = np.concatenate([one.values for one in found])
    options = DictionarySetOptions(views=("gist", "lbp:half"), sizes=(2,), components=4)
    words = DictionarySet.fit(values, spec=found[0].spec, options=options)
    words.save(tmp_path / "words.npz")
    gist, lbp = words.dictionaries
    of_words = see([ALL], job.part(words.spec), gist, words)[ALL].points[3]
    assert of_words.shape == (12, 8)
    part = job.test[0].load().part(lbp.spec).values
    np.testing.assert_allclose(np.corrcoef(of_words[:, 4:].ravel(), project(part, lbp.pca).ravel())[0, 1], 1, atol=1e-6)
    with pytest.raises(
        EvaluationError,
        match=r"methods @ranks:pn: there are no ranks descriptors beside those of gist\+lbp; leave them",
    ):
        compare([runs], [runs / "run3"], tmp_path / "out", methods=["knn@ranks:pn"], words=tmp_path / "words.npz")
    assert not (tmp_path / "out/cache/descriptors").exists()
