"""One joint driven by a voltage or by nothing: named by the motion that is simulated in open loop."""
