"""Support vector machines with a Gaussian kernel on the descriptor's components: the strongest of the plain peers.

scikit-learn's, one against the rest; C and gamma are those of `STRENGTHS` and `GAMMAS` with the least log loss on
training sequences that were held out (five groups of them at most), where a temperature is fitted too
(`methods.margins`).
"""

from itertools import product

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import check_optional
from placerec.methods.descriptors import DescriptorTrainingSet, FitPoints
from placerec.methods.logistic import MOST_FRAMES
from placerec.methods.margins import FitMargins, Margins, best_machine
from placerec.model.evidence import GROUPS

# scikit-learn's C and gamma, for points in units of their root mean square; the first where nothing can be held out.
STRENGTHS = (10.0, 1.0, 100.0)
GAMMAS = (1.0, 1 / 16, 1 / 4, 4.0)


def choose(training: DescriptorTrainingSet, *, seed: int = 0) -> FitPoints:
    """What fits the scores of points (C,), as the training asks for; MissingExtraError without scikit-learn."""
    check_optional("sklearn", "rbf-svm")
    from sklearn.svm import SVC

    def of_options(strength: float, gamma: float) -> FitMargins:
        def machine(points: Floats, truth: Ints) -> Margins:
            columns = np.unique(truth)
            weights, offsets = np.zeros((len(columns), len(points))), np.zeros(len(columns))
            for row, column in enumerate(columns):
                found = SVC(C=strength, gamma=gamma, random_state=seed).fit(points, truth == column)
                weights[row, found.support_], offsets[row] = found.dual_coef_[0], found.intercept_[0]
            used = weights.any(axis=0)
            return kernel_margins(points[used], weights[:, used], offsets, gamma)

        return machine

    machines = [of_options(*options) for options in product(STRENGTHS, GAMMAS)]
    return best_machine(training, machines, GROUPS, MOST_FRAMES)


def kernel_margins(support: Floats, weights: Floats, offsets: Floats, gamma: float) -> Margins:
    """The margins of machines over `support` float64 (s, k), `weights` (D, s) and `offsets` (D,)."""
    lengths = np.square(support).sum(axis=1)

    def margins(points: Floats) -> Floats:
        # Not BLAS, whose sums depend on the number of its threads.
        products = np.einsum("nk,sk->ns", points, support)
        apart = np.square(points).sum(axis=1)[:, None] + lengths - 2 * products
        reached: Floats = np.einsum("ns,cs->nc", np.exp(-gamma * np.maximum(apart, 0.0)), weights) + offsets
        return reached

    return margins
