"""A probability in words that never say more than is known."""


def sure(probability: float) -> str:
    """A probability in percent that never says 100 % where it is less."""
    return f"{100.0 * probability:.1f} %" if probability < 0.9995 else "over 99.9 %"
