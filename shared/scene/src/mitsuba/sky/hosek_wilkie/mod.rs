//! The sky of Hosek and Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance" (2012), in RGB: its
//! coefficients for one sun position.

/// The authors' RGB data in single precision, little-endian: nine parameters per channel, then the mean radiance per
/// channel. Their licence is in `LICENSE` next to this file.
const COEFFICIENTS: &[u8] = include_bytes!("coefficients.f32");
const TURBIDITIES: usize = 10;
/// Parameters of the radiance distribution.
const PARAMETERS: usize = 9;
/// Control points of a quintic over the sun's elevation.
const POINTS: usize = 6;
const CHANNELS: usize = 3;

/// Each channel's nine parameters of the distribution, in the order of the authors' program, and its factor.
pub type Coefficients = ([[f32; PARAMETERS]; CHANNELS], [f32; CHANNELS]);

/// The coefficients for the sun's `elevation` from 0 to pi/2, a turbidity from 1 to 10, and a ground albedo from 0 to
/// 1.
pub fn coefficients(elevation: f32, turbidity: f32, albedo: [f32; CHANNELS]) -> Result<Coefficients, String> {
    if !(1.0..=TURBIDITIES as f32).contains(&turbidity) {
        return Err(format!("its turbidity is {turbidity}; expected 1 to {TURBIDITIES}"));
    }
    if albedo.iter().any(|a| !(0.0..=1.0).contains(a)) {
        return Err(format!("the ground's albedo is {albedo:?}; expected 0 to 1"));
    }
    let at = libm::powf(elevation / (0.5 * std::f32::consts::PI), 1.0 / 3.0);
    let means = CHANNELS * Table::<PARAMETERS>::LENGTH;
    let shapes = std::array::from_fn(|c| {
        let table = Table::<PARAMETERS>(c * Table::<PARAMETERS>::LENGTH);
        std::array::from_fn(|parameter| table.between(parameter, turbidity, albedo[c], at))
    });
    let strengths = std::array::from_fn(|c| {
        let table = Table::<1>(means + c * Table::<1>::LENGTH);
        table.between(0, turbidity, albedo[c], at)
    });
    Ok((shapes, strengths))
}

/// Offset of one channel's `N` parameters among the numbers, ordered by albedo (0 and 1), turbidity and control point.
struct Table<const N: usize>(usize);

impl<const N: usize> Table<N> {
    const LENGTH: usize = 2 * TURBIDITIES * POINTS * N;

    /// One parameter, interpolated linearly in albedo and turbidity.
    fn between(&self, parameter: usize, turbidity: f32, albedo: f32, at: f32) -> f32 {
        let rest = turbidity.fract();
        // Turbidity starts at one.
        let below = turbidity.trunc() as usize - 1;
        let above = (below + 1).min(TURBIDITIES - 1);
        let mut sum = 0.0;
        for (ground, share) in [(0, 1.0 - albedo), (1, albedo)] {
            for (turbidity, weight) in [(below, 1.0 - rest), (above, rest)] {
                let row = ground * TURBIDITIES + turbidity;
                sum += share * weight * self.quintic(row, parameter, at);
            }
        }
        sum
    }

    /// The Bézier curve of a row's control points.
    fn quintic(&self, row: usize, parameter: usize, at: f32) -> f32 {
        let powers = |x: f32| {
            let (second, third) = (x * x, x * x * x);
            [1.0, x, second, third, second * second, second * second * x]
        };
        let (rising, falling) = (powers(at), powers(1.0 - at));
        let mut sum = 0.0;
        for (i, binomial) in [1.0, 5.0, 10.0, 10.0, 5.0, 1.0].into_iter().enumerate() {
            let point = number(self.0 + (row * POINTS + i) * N + parameter);
            sum += point * binomial * falling[POINTS - 1 - i] * rising[i];
        }
        sum
    }
}

fn number(index: usize) -> f32 {
    let (numbers, _) = COEFFICIENTS.as_chunks();
    f32::from_le_bytes(numbers[index])
}
