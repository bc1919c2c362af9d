//! Numerical integration over rectangles.

/// Nodes and weights of the Gauss-Legendre rule of 5 points on [-1, 1].
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// A rectangle [x.0, x.1] x [y.0, y.1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Range of the first coordinate.
    pub x: (f64, f64),
    /// Range of the second coordinate.
    pub y: (f64, f64),
}

impl Rect {
    fn quarters(&self) -> [Self; 4] {
        let xm = 0.5 * (self.x.0 + self.x.1);
        let ym = 0.5 * (self.y.0 + self.y.1);
        [
            ((self.x.0, xm), (self.y.0, ym)),
            ((xm, self.x.1), (self.y.0, ym)),
            ((self.x.0, xm), (ym, self.y.1)),
            ((xm, self.x.1), (ym, self.y.1)),
        ]
        .map(|(x, y)| Self { x, y })
    }
}

fn gauss(f: &impl Fn(f64, f64) -> f64, rect: Rect) -> f64 {
    let (cx, hx) = (0.5 * (rect.x.0 + rect.x.1), 0.5 * (rect.x.1 - rect.x.0));
    let (cy, hy) = (0.5 * (rect.y.0 + rect.y.1), 0.5 * (rect.y.1 - rect.y.0));
    let mut sum = 0.0;
    for (x, wx) in GAUSS {
        for (y, wy) in GAUSS {
            sum += wx * wy * f(cx + hx * x, cy + hy * y);
        }
    }
    sum * hx * hy
}

/// Integral of `f` over `rect` by adaptive quartering with a Gauss rule. `tolerance` maps a first estimate of the
/// integral to the acceptable absolute error; quartering ends after `max_depth` levels in any case. A quarter may have
/// half of its parent's error: along an edge of `f` the number of refined cells doubles with each level.
pub fn integrate(f: &impl Fn(f64, f64) -> f64, rect: Rect, max_depth: u32, tolerance: impl Fn(f64) -> f64) -> f64 {
    let coarse = gauss(f, rect);
    let fine: f64 = rect.quarters().map(|q| gauss(f, q)).iter().sum();
    refine(f, rect, coarse, tolerance(fine), max_depth)
}

fn refine(f: &impl Fn(f64, f64) -> f64, rect: Rect, coarse: f64, tolerance: f64, depth: u32) -> f64 {
    let quarters = rect.quarters();
    let parts = quarters.map(|q| gauss(f, q));
    let fine: f64 = parts.iter().sum();
    if depth == 0 || (fine - coarse).abs() <= tolerance {
        return fine;
    }
    (0..4)
        .map(|i| refine(f, quarters[i], parts[i], 0.5 * tolerance, depth - 1))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: Rect = Rect {
        x: (-1.0, 1.0),
        y: (-1.0, 1.0),
    };

    #[test]
    fn smooth_and_kinked_functions() {
        let polynomial = integrate(&|x, y| x * x * y * y, SQUARE, 8, |_| 1e-12);
        assert!((polynomial - 4.0 / 9.0).abs() < 1e-12);
        let disk = |x: f64, y: f64| f64::from(x * x + y * y < 1.0);
        let area = integrate(&disk, SQUARE, 9, |_| 1e-9);
        assert!((area - std::f64::consts::PI).abs() < 1e-3, "{area}");
    }
}
