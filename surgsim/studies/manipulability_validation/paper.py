"""The numbers that the manipulability paper prints."""

ByPath = dict[str, tuple[float, ...]]
"""Numbers of homes 1 to 4 by path."""

PATHS = ("circle", "sinusoid", "spiral")
HOMES = (1, 2, 3, 4)

TABLE_4_NOT_OPTIMISED: ByPath = {
    "circle": (0.0406, 0.0282, 0.0246, 0.0356),
    "sinusoid": (0.0447, 0.0281, 0.0222, 0.0233),
    "spiral": (0.0393, 0.0280, 0.0253, 0.0342),
}
"""Averages of mu over the steps."""

TABLE_4_OPTIMISED: ByPath = {
    "circle": (0.0448, 0.0287, 0.0264, 0.0466),
    "sinusoid": (0.0512, 0.0303, 0.0249, 0.0363),
    "spiral": (0.0429, 0.0282, 0.0262, 0.0465),
}

TABLE_4_INCREASE: ByPath = {
    "circle": (0.0042, 0.0005, 0.0018, 0.0110),
    "sinusoid": (0.0065, 0.0022, 0.0027, 0.0130),
    "spiral": (0.0036, 0.0003, 0.0010, 0.0123),
}

TABLE_4_INCREASE_PERCENT: ByPath = {
    "circle": (10.3, 1.8, 7.3, 30.9),
    "sinusoid": (14.5, 7.8, 12.2, 55.8),
    "spiral": (9.2, 1.1, 3.9, 36.0),
}

TABLE_5_OPTIMISED: ByPath = {
    "circle": (3.992, 3.876, 2.433, 1.967),
    "sinusoid": (5.657, 5.074, 3.072, 3.398),
    "spiral": (5.964, 4.934, 4.389, 3.778),
}
"""Root mean square tip errors [1e-4 m]."""

TABLE_5_PSEUDO_INVERSE: ByPath = {
    "circle": (1.148, 1.189, 1.162, 1.161),
    "sinusoid": (2.588, 2.062, 1.980, 3.760),
    "spiral": (3.891, 3.818, 4.151, 3.590),
}
