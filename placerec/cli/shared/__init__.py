"""Options that several commands share: one spelling, one meaning, by subject."""

from placerec.cli.shared import groups as groups
from placerec.cli.shared.common import (
    as_in_paper as as_in_paper,
    dictionary_option as dictionary_option,
    output_option as output_option,
    seed_option as seed_option,
    words_option as words_option,
)
from placerec.cli.shared.decoding import decoding_options as decoding_options
from placerec.cli.shared.descriptors import (
    descriptor_options as descriptor_options,
    matrix_option as matrix_option,
    network_option as network_option,
)
from placerec.cli.shared.groups import command as command
from placerec.cli.shared.models import SMOOTHING_NAMES as SMOOTHING_NAMES, model_options as model_options
from placerec.cli.shared.pages import live_page_options as live_page_options, page_options as page_options
from placerec.cli.shared.sources import (
    reading_options as reading_options,
    source_arguments as source_arguments,
    tokens_argument as tokens_argument,
    whole_source_arguments as whole_source_arguments,
)
from placerec.cli.shared.talk import (
    echo_json as echo_json,
    json_option as json_option,
    log as log,
    progress_bar as progress_bar,
    talk_options as talk_options,
)
from placerec.cli.shared.values import (
    FILE as FILE,
    PATH as PATH,
    PATH_OR_STREAM as PATH_OR_STREAM,
    usage as usage,
)
from placerec.cli.shared.words import dictionary_options as dictionary_options
from placerec.cli.shared.work import (
    cache_option as cache_option,
    cluster_option as cluster_option,
    jobs_option as jobs_option,
    work_options as work_options,
)
