"""Joint axes and centres of the BeBionic hand as published: "Modelling of Robotic Hands: Kinematic and Dynamic
Parameter Identification", tables 4.1 to 4.4.

In the landmark frame, [proximal, distal]; axes are unit vectors to three digits, centres are in metres.
"""

Pair = list[list[float]]

AXES: dict[str, dict[str, Pair]] = {
    "left": {
        "index": [[0.092, 0.986, 0.141], [0.113, 0.988, 0.102]],
        "middle": [[0.059, 0.998, 0.038], [0.065, 0.997, 0.045]],
        "ring": [[0.026, 0.993, -0.112], [0.054, 0.996, -0.076]],
        "little": [[-0.048, 0.989, -0.133], [0.02, 0.985, -0.17]],
    },
    "right": {
        "index": [[-0.088, 0.986, -0.139], [-0.098, 0.985, -0.141]],
        "middle": [[0.009, 0.997, -0.08], [-0.038, 0.999, 0.015]],
        "ring": [[0.03, 0.999, 0.026], [-0.037, 0.993, 0.115]],
        "little": [[0.077, 0.992, 0.091], [0.046, 0.978, 0.202]],
    },
}
CENTRES: dict[str, dict[str, Pair]] = {
    "left": {
        "index": [[0.045, -0.027, 0.004], [0.076, -0.033, 0.005]],
        "middle": [[0.047, -0.009, 0.009], [0.082, -0.015, 0.018]],
        "ring": [[0.048, 0.007, 0.009], [0.081, 0.006, 0.017]],
        "little": [[0.045, 0.027, 0.004], [0.076, 0.029, 0.013]],
    },
    "right": {
        "index": [[0.047, 0.024, 0.005], [0.075, 0.027, 0.011]],
        "middle": [[0.049, 0.008, 0.01], [0.085, 0.009, 0.021]],
        "ring": [[0.048, -0.007, 0.009], [0.082, -0.011, 0.017]],
        "little": [[0.043, -0.026, 0.005], [0.073, -0.032, 0.01]],
    },
}
