"""Ullah, Pronobis, Caputo, Luo & Jensfelt 2008: support vector machines, one image at a time.

M. Ullah, A. Pronobis, B. Caputo, J. Luo, P. Jensfelt: "Towards robust place recognition for robot localization", ICRA
2008, the baseline that came with the COLD data. Theirs matches local features (Harris-Laplace, SIFT) inside the kernel
(from memory); here a linear machine of scikit-learn (one against the rest, C = 1, its defaults) sees the dictionary's
global descriptor, so that what differs from the other systems is the decision and not the feature. Its margins become
beliefs as `methods.margins` says, frame by frame or, which is not in the paper, through the filter.
"""

from placerec.arrays import Floats, Ints
from placerec.errors import check_optional
from placerec.methods.descriptors import MOST_FOLDS, DescriptorTrainingSet, FitPoints
from placerec.methods.margins import Margins, best_machine, linear_margins


def choose(training: DescriptorTrainingSet, *, seed: int = 0) -> FitPoints:
    """What fits the scores of points (C,), as the training asks for; MissingExtraError without scikit-learn."""
    check_optional("sklearn", "ullah2008")
    from sklearn.svm import LinearSVC

    def machine(points: Floats, truth: Ints) -> Margins:
        found = LinearSVC(dual=False, random_state=seed).fit(points, truth)
        return linear_margins(found.coef_, found.intercept_)

    return best_machine(training, [machine], MOST_FOLDS)
