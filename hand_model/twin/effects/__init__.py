"""Effects that the twin can hide, grouped by the station of the signal path where they act."""
