"""Command line: python -m fifth_recorder OUT --seed S --single N --none N --outside N --pair N --weak N --messy N."""

from make_set_command import main

from fifth_recorder.compose import KINDS, make_set

if __name__ == "__main__":
    main("fifth_recorder", KINDS, make_set)
