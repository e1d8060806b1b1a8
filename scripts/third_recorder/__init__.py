"""A third recorder: sessions of a prosthetic hand with physical effects hidden in them; its motor is simulated in C."""
