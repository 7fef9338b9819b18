"""SRILM's tools as commands: arguments go through untouched, for the tools have their own rules for options."""

import sys
from typing import TYPE_CHECKING

import click

from placerec.srilm.tools.run import TOOLS, run

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_PURPOSES = {
    "ngram-count": "Count n-grams, estimate models.",
    "ngram": "Score text; mix, prune models.",
    "ngram-merge": "Add up sorted counts files.",
    "compute-best-mix": "Weights for a mixture of models.",
    "change-lm-vocab": "Change a model's vocabulary.",
    "add-ppls": "Add up ngram -ppl outputs.",
    "disambig": "Find hidden words behind words.",
    "hidden-ngram": "Find events between words.",
    "ngram-class": "Make classes of words.",
    "replace-words-with-classes": "Classes for words in text.",
    "uniform-classes": "Equal shares within classes.",
    "subtract-ppls": "Take ngram -ppl outputs from one.",
    "sort-lm": "Sort a model's n-grams.",
    "make-sub-lm": "Leave out long n-grams.",
    "get-unigram-probs": "A model's words and their p.",
    "get-gt-counts": "Counts of counts.",
    "make-gt-discounts": "Good-Turing parameters.",
    "make-kn-discounts": "Kneser-Ney parameters.",
    "make-abs-discount": "An absolute discount.",
    "make-big-lm": "Models of many counts.",
    "make-batch-counts": "Count many texts.",
    "merge-batch-counts": "Merge what was counted.",
    "reverse-lm": "A bigram model, backwards.",
    "ppl-from-log": "Totals of single tokens.",
    "compare-ppls": "Two models, token by token.",
    "select-vocab": "Weigh words by a text.",
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
    "make-batch-counts": "texts.list 10 cat counts -order 3",
    "merge-batch-counts": "counts",
    "reverse-lm": "bigrams.lm",
    "ppl-from-log": "part.ppl",
    "compare-ppls": "mindelta=0.01 a.ppl b.ppl",
    "select-vocab": "-heldout tune.txt news.txt talks.counts",
}


class Tool(click.Command):
    """A command that leaves its arguments, `--` too, to the tool of its name; `--help` alone says what it is for."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the arguments as they are."""
        if args in (["-h"], ["--help"]):
            click.echo(f"SRILM's tool. {_PURPOSES[str(self.name)]}\n")
            click.echo("Its options are SRILM's: docs/srilm.md, or -help, lists them.\n")
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
