"""What is measured on pictures."""

import numpy as np

TILES = 4


def read(file):
    """R, G, B of an EXR by any of the renderers."""
    import OpenEXR

    channels = OpenEXR.File(str(file)).channels()
    for name in ("RGB", "RGBA", "ViewLayer.Combined.RGBA", "ViewLayer.Combined"):
        if name in channels:
            return channels[name].pixels[..., :3].astype(np.float64)
    return np.stack([channels[name].pixels for name in "RGB"], -1).astype(np.float64)


def tiles(image):
    """Means over all channels of a picture's 4 x 4 parts."""
    n = image.shape[0] // TILES * TILES
    return image[:n, :n].reshape(TILES, n // TILES, TILES, n // TILES, -1).mean((1, 3, 4))


class Agreement:
    """Ratios of means of two sets of independent pictures, of the whole and of its worst part, with standard errors."""

    def __init__(self, ours, theirs):
        def ratio(measure):
            a, b = (np.array([measure(image) for image in images]) for images in (ours, theirs))
            means = a.mean(0), b.mean(0)
            # A part may be black after a moment.
            error = [x.std(0, ddof=1) / np.sqrt(len(x)) / np.maximum(x.mean(0), 1e-9) for x in (a, b)]
            return means[0] / means[1], np.hypot(*error) * np.maximum(means[0] / means[1], 1e-9)

        self.mean, self.error = ratio(np.mean)
        parts, errors = (values.ravel() for values in ratio(tiles))
        # The part that is off by most, less what noise explains.
        worst = np.argmax(np.abs(parts - 1) - 3 * errors)
        self.part, self.part_error = parts[worst], errors[worst]
        self.clear = bool(0 < self.error < 0.03 and self.mean > 0.01)
        # Three standard errors of so few pictures are not rare in 16 parts.
        self.good = bool(abs(self.mean - 1) < 3 * self.error + 0.01
                         and abs(self.part - 1) < 4 * self.part_error + 0.03)
        # A difference d of all pixels adds d^2 to the relMSE: below this it is small beside what is measured.
        self.usable = self.clear and (self.good or bool(abs(self.mean - 1) < 3 * self.error + 0.1))

    def __str__(self):
        return (f"mean {self.mean:.3f} ± {self.error:.3f}, worst of 16 parts {self.part:.3f} ± {self.part_error:.3f}"
                + (": TOO NOISY TO TELL" if not self.clear else "" if self.good else
                   ": NOT QUITE THE SAME" if self.usable else ": NOT THE SAME"))


class Reference:
    """The mean of two independent pictures, and its own noise by their difference."""

    def __init__(self, halves):
        self.image = np.mean(halves, 0)
        self.weight = 1 / (self.image**2 + 0.01)
        self.noise = (((halves[0] - halves[1]) / 2) ** 2 * self.weight).mean(-1)
        self.witness = None

    def errors(self, image):
        """relMSE less the reference's own noise, of all pixels and without the 0.1 % that are off by most."""
        error = ((image - self.image) ** 2 * self.weight).mean(-1)
        kept = error <= np.quantile(error, 0.999)
        # No more can be said of what is below a tenth of the reference's noise.
        less = lambda error, noise: max((error - noise).mean(), 0.1 * noise.mean())
        return less(error, self.noise), less(error[kept], self.noise[kept])


def seconds_to(points, error):
    """Seconds to an error by points of (seconds, error), and whether they are extrapolated.

    Straight in log-log. Beyond the points it falls as the nearest two say, but as t^-1 at most (nothing here is faster)
    and as t^-0.5 at least: single bright pixels may hide that it falls.
    """
    (t, e), known = np.log(np.array(points, float)).T, np.log(error)
    if len(t) == 1:
        return float(np.exp(t[0] + e[0] - known)), abs(e[0] - known) > 1e-9
    if abs(e[0] - known) < 1e-9:
        return float(np.exp(t[0])), False
    for i in range(len(t) - 1):
        if e[i + 1] <= known < e[i]:
            return float(np.exp(t[i] + (known - e[i]) / (e[i + 1] - e[i]) * (t[i + 1] - t[i]))), False
    side = (0, 1, 0) if known > e[0] else (-2, -1, -1)
    slope = np.clip((e[side[1]] - e[side[0]]) / (t[side[1]] - t[side[0]]), -1, -0.5)
    return float(np.exp(t[side[2]] + (known - e[side[2]]) / slope)), True
