"""An evaluation as a notebook shows it: the numbers, and what was taken for what."""

from html import escape

import numpy as np

from placerec.evaluation.metrics import Evaluation
from placerec.evaluation.summary import percent

# A larger table is told in words.
_MOST_PLACES = 30


def evaluation_html(evaluation: Evaluation) -> str:
    """The evaluation as HTML that needs nothing else."""
    majority = f"always {evaluation.majority_place}: {percent(evaluation.majority_accuracy)}"
    head = (
        f"<b>{percent(evaluation.accuracy)}</b> of {evaluation.frames} frames right ({escape(majority)}); balanced "
        f"{percent(evaluation.balanced_accuracy)}, log loss {evaluation.log_loss:.3f} nats per frame, "
        f"ECE {evaluation.ece:.3f}"
    )
    if len(evaluation.places) > _MOST_PLACES:
        return f"<div><p>{head}; {len(evaluation.places)} places</p></div>"
    names = [escape(place) for place in evaluation.places]
    columns = "".join(f"<th>{name}</th>" for name in names)
    titles = f"<tr><th>true, and taken for</th>{columns}<th>recall</th><th>precision</th></tr>"
    shares = evaluation.confusion / np.maximum(1, evaluation.confusion.sum(axis=1, keepdims=True))
    rows = []
    for k, (name, score) in enumerate(zip(names, evaluation.per_place.values(), strict=True)):
        cells = "".join(
            f'<td style="background:rgba(0,114,178,{share:.2f})">{count}</td>'
            for count, share in zip(evaluation.confusion[k].tolist(), shares[k].tolist(), strict=True)
        )
        rows.append(
            f"<tr><th>{name}</th>{cells}<td>{percent(score.recall)}</td><td>{percent(score.precision)}</td></tr>"
        )
    return f"<div><p>{head}</p><table>{titles}{''.join(rows)}</table></div>"
