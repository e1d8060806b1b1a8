"""python -m eighth_recorder OUT --seed S --single N ..."""

from make_set_command import main

from eighth_recorder.compose import KINDS, make_set

main("eighth_recorder", KINDS, make_set)
