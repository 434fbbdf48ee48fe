"""Numbers with as many digits as their standard deviations carry."""

import math

_SHORTEST = 1e-6  # smaller sigmas would need too many zeros: powers of ten instead
_CONSTANT = 10  # significant digits of a value without a sigma
_DIGITS_MOST = 15  # digits of a double


def decimals(sigma: float) -> int:
    """Decimals that show two significant digits of a positive sigma."""
    return max(0, 1 - math.floor(math.log10(sigma)))


def with_sigma(value: float, sigma: float) -> tuple[str, str]:
    """A value with the digits that its sigma allows, and the sigma with two; "-" for the sigma of a constant."""
    if not (math.isfinite(sigma) and sigma > 0.0):
        return f"{value:.{_CONSTANT}g}", "-"
    if sigma >= _SHORTEST:
        places = decimals(sigma)
        return f"{value:.{places}f}", f"{sigma:.{places}f}"
    largest = math.floor(math.log10(abs(value))) if value else math.floor(math.log10(sigma))
    digits = min(_DIGITS_MOST, max(0, largest - math.floor(math.log10(sigma)) + 1))
    return f"{value:.{digits}e}", f"{sigma:.1e}"


def residual(v: float, sigma: float) -> str:
    """A residual with one digit more than the sigma of its observation."""
    return f"{v:.{decimals(sigma) + 1}f}" if sigma >= _SHORTEST else f"{v:.3g}"


def tested(number: float, places: int) -> str:
    """A redundancy number or test value; "-" where there is none."""
    return f"{number:.{places}f}" if math.isfinite(number) else "-"


def sized(number: float) -> str:
    """A size with three significant digits; "-" where it has no limit."""
    return f"{number:.3g}" if math.isfinite(number) else "-"
