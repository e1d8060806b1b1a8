"""Effects put into recordings of a hand that lacks them: the hand, the laboratory and the noise stay a foreign one's."""
