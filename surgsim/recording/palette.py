"""Colours that people with a colour vision deficiency can tell apart (Okabe and Ito 2008), RGB."""

ORANGE = (230, 159, 0)
SKY = (86, 180, 233)
GREEN = (0, 158, 115)
YELLOW = (240, 228, 66)
BLUE = (0, 114, 178)
VERMILION = (213, 94, 0)
PINK = (204, 121, 167)
BLACK = (0, 0, 0)
OLIVE = (153, 153, 51)
GREY = (150, 150, 150)

SERIES = (ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PINK, OLIVE)
"""Of the joints and other series of a plot, in turn; olive is of Paul Tol's muted scheme."""


def hexadecimal(color: tuple[int, int, int]) -> str:
    """A colour as `#RRGGBB`.

    Example:
        >>> hexadecimal(VERMILION)
        '#D55E00'
    """
    return "#{:02X}{:02X}{:02X}".format(*color)
