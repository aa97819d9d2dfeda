"""Values as nobody would state them: usual ones mixed with ones far off, and with ones that are none."""

import numpy as np

SPECIAL = ("0", "-1", "1e-300", "5e-324", "1e-40", "1e40", "1e300", "1e-12", "1e12")
"""Numbers at the edge of what a number can be."""

WILD = (0.0, 0.03, 0.15, 0.5)
"""How often a value is absurd; each run has one of these."""


class Draws:
    """A random stream of values, ``wild`` of which are absurd."""

    def __init__(self, rng):
        self.rng = rng
        self.wild = float(rng.choice(WILD))

    def chance(self, probability):
        return bool(self.rng.random() < probability)

    def absurd(self):
        return self.chance(self.wild)

    def pick(self, *choices):
        return choices[int(self.rng.integers(len(choices)))]

    def log(self, low, high):
        """Log-uniform from low to high."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def factor(self, decades):
        """1, or where it is absurd a factor of up to so many powers of ten either way."""
        return 10.0 ** self.rng.uniform(-decades, decades) if self.absurd() else 1.0

    def text(self, usual, unit, decades=6.0):
        """A quantity, usual or not."""
        if self.absurd() and self.chance(0.05):
            return f"{self.pick(*SPECIAL)} {unit}".strip()
        return f"{usual * self.factor(decades):.9g} {unit}".strip()

    def uncertain(self, value, u, unit, decades=4.0):
        """A quantity with a standard uncertainty."""
        return f"{value:.12g} ± {u * self.factor(decades):.3g} {unit}"

    def angle(self):
        """An angle, in degrees: a round one or any."""
        if self.absurd():
            return self.pick(0.0, 1e-9, 90.0, -90.0, 180.0, 360.0, 1e4, -1e7, 45.0, 1e-3)
        return float(self.rng.uniform(-180.0, 180.0))

    def latitude(self):
        """A latitude; the poles and the equator more often than on earth."""
        if self.absurd():
            return self.pick("90 deg", "-90 deg", "0 deg", "89.9999999 deg", "1e-9 deg", "40(30) deg")
        return self.pick("40 deg", "40.0(1) deg", f"{self.rng.uniform(-80.0, 80.0):.6f} deg")

    def site(self):
        """A table [site]."""
        table = {"latitude": self.latitude()}
        if self.chance(0.3):
            table["height"] = self.pick("0 m", "120(5) m", "-900 m", "19 km")
        if self.chance(0.4):
            table["gravity"] = self.pick("9.8 m/s^2", "9.8101(1) m/s^2", "9.6 m/s^2", "9.8(5) m/s^2")
            if self.absurd():
                table["gravity"] = self.pick(
                    "0 m/s^2", "274 m/s^2", *["9.8 ± 99 m/s^2", "9.6 ± 1e9 m/s^2"] * 3
                )
        return table
