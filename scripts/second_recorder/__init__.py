"""A second recorder: sessions of a prosthetic hand with physical effects hidden in them."""
