"""Multinomial logistic regression on the descriptor's components: what a careful user would try first.

scikit-learn's, with a quadratic penalty; its strength is the one of `STRENGTHS` with the least log loss on training
sequences that were held out (five groups of them at most), where a temperature is fitted too (`methods.margins`).
"""

from placerec.arrays import Floats, Ints
from placerec.errors import check_optional
from placerec.methods.descriptors import DescriptorTrainingSet, FitPoints
from placerec.methods.margins import FitMargins, Margins, best_machine, linear_margins
from placerec.model.evidence import GROUPS

# scikit-learn's C, for points in units of their root mean square; the first where nothing can be held out.
STRENGTHS = (10.0, 0.1, 1.0, 100.0, 1000.0)
MOST_FRAMES = 2000


def choose(training: DescriptorTrainingSet, *, seed: int = 0) -> FitPoints:
    """What fits the scores of points (C,), as the training asks for; MissingExtraError without scikit-learn."""
    check_optional("sklearn", "logistic")
    from sklearn.linear_model import LogisticRegression
    from threadpoolctl import threadpool_limits

    def of_strength(strength: float) -> FitMargins:
        def machine(points: Floats, truth: Ints) -> Margins:
            # The sums of BLAS depend on the number of its threads.
            with threadpool_limits(1):
                found = LogisticRegression(C=strength, max_iter=2000, random_state=seed).fit(points, truth)
            return linear_margins(found.coef_, found.intercept_)

        return machine

    return best_machine(training, [of_strength(strength) for strength in STRENGTHS], GROUPS, MOST_FRAMES)
