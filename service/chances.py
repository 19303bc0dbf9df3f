"""A probability in words that never say more than is known."""


def sure(probability: float) -> str:
    """A probability in percent that never says 100 % where it is less."""
    return f"{100.0 * probability:.1f} %" if probability < 0.9995 else "over 99.9 %"


def share(part: float) -> str:
    """A part in whole percents that never says 0 or 100 % where it is neither."""
    if 0.0 < part < 0.01:
        return "under 1 %"
    return f"{100.0 * part:.0f} %" if part < 0.995 or part >= 1.0 else "over 99 %"
