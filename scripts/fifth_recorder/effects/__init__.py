"""Ways to hide something in a recording, by where it acts."""
