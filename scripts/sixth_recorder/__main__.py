"""Command line: python -m sixth_recorder OUT --seed S --single N --none N --pair N --weak N --messy N --outside N."""

from make_set_command import main

from sixth_recorder.compose import KINDS, make_set

if __name__ == "__main__":
    main("sixth_recorder", KINDS, make_set)
