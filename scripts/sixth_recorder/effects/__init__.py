"""What can be hidden: laws of the recorder's own, several variants per effect, one amplitude each; all in `table`."""
