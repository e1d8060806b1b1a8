"""A fourth recorder: sessions of a prosthetic hand with LuGre friction, whose effects are sized by what they bring over
the best healthy model; its motor is simulated in C."""
