"""SRILM's tools as commands: arguments go through untouched, for the tools have their own rules for options."""

import sys
from typing import TYPE_CHECKING

import click

from placerec.srilm.tools.run import TOOLS, run

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_PURPOSES = {
    "ngram-count": "SRILM's tool: count n-grams, estimate models.",
    "ngram": "SRILM's tool: score text; mix, prune models.",
    "ngram-merge": "SRILM's tool: add up sorted counts files.",
    "compute-best-mix": "SRILM's tool: weights for a mixture of models.",
    "change-lm-vocab": "SRILM's tool: change a model's vocabulary.",
    "add-ppls": "SRILM's tool: add up ngram -ppl outputs.",
    "disambig": "SRILM's tool: find hidden words behind words.",
    "hidden-ngram": "SRILM's tool: find events between words.",
    "ngram-class": "SRILM's tool: make classes of words.",
    "replace-words-with-classes": "SRILM's tool: classes for words in text.",
    "uniform-classes": "SRILM's tool: equal shares within classes.",
    "subtract-ppls": "SRILM's tool: take ngram -ppl outputs from one.",
    "sort-lm": "SRILM's tool: sort a model's n-grams.",
    "make-sub-lm": "SRILM's tool: leave out long n-grams.",
    "get-unigram-probs": "SRILM's tool: a model's words and their p.",
    "get-gt-counts": "SRILM's tool: counts of counts.",
    "make-gt-discounts": "SRILM's tool: Good-Turing parameters.",
    "make-kn-discounts": "SRILM's tool: Kneser-Ney parameters.",
    "make-abs-discount": "SRILM's tool: an absolute discount.",
    "make-big-lm": "SRILM's tool: models of many counts.",
}


EXAMPLES = {
    "ngram-count": "-text train.txt -order 3 -wbdiscount -interpolate -lm train.lm",
    "ngram": "-order 3 -lm train.lm -ppl test.txt",
    "ngram-merge": "-write all.counts monday.counts tuesday.counts",
    "compute-best-mix": "a.ppl b.ppl",
    "change-lm-vocab": "-vocab words.txt -lm train.lm -write-lm new.lm",
    "add-ppls": "monday.ppl tuesday.ppl",
    "disambig": "-map frames.map -text frames.txt -lm places.lm",
    "hidden-ngram": "-text stream.txt -lm events.lm -hidden-vocab events.txt",
    "ngram-class": "-text train.txt -numclasses 50 -classes words.classes",
    "replace-words-with-classes": "classes=words.classes train.txt",
    "uniform-classes": "words.classes",
    "subtract-ppls": "all.ppl monday.ppl",
    "sort-lm": "train.lm",
    "make-sub-lm": "maxorder=2 train.lm",
    "get-unigram-probs": "linear=1 train.lm",
    "get-gt-counts": "out=all all.counts",
    "make-gt-discounts": "min=1 max=7 all.gt2counts",
    "make-kn-discounts": "min=1 all.gt3counts",
    "make-abs-discount": "all.gt2counts",
    "make-big-lm": "-name all -read all.counts -lm all.lm",
}


class Tool(click.Command):
    """A command that leaves its arguments, `--` too, to the tool of its name; `--help` alone says what it is for."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the arguments as they are."""
        if args in (["-h"], ["--help"]):
            click.echo(
                f"{_PURPOSES[str(self.name)]}\n\nIts options are SRILM's: docs/srilm.md, or -help, lists them.\n"
            )
            click.echo(f"Example: placerec {self.name} {EXAMPLES[str(self.name)]}")
            ctx.exit()
        ctx.args = list(args)
        return ctx.args

    def shell_complete(self, ctx: click.Context, incomplete: str) -> "list[CompletionItem]":
        """A file: to know the tool's options would be to import it."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]

    def invoke(self, ctx: click.Context) -> None:
        """Run the tool and end with its exit status."""
        sys.exit(run(str(self.name), ctx.args, shown=f"placerec {self.name}"))


SRILM_COMMANDS = tuple(Tool(tool, short_help=_PURPOSES[tool], add_help_option=False) for tool in TOOLS)
