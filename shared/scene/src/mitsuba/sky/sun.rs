//! The sun's position and irradiance.

/// A time and place on the earth.
pub struct Moment {
    /// Degrees, like the longitude.
    pub latitude: f64,
    pub longitude: f64,
    pub year: i64,
    pub month: i64,
    pub day: i64,
    /// Universal time, hours; may be negative or above 24.
    pub hour: f64,
}

/// Direction to the sun as a unit vector: east, north, up.
///
/// Source: Blanco-Muriel et al., "Computing the Solar Vector" (2001).
pub fn position(moment: &Moment) -> [f64; 3] {
    let Moment {
        year, month, day, hour, ..
    } = *moment;
    // The Julian day (Fliegel and Van Flandern), in integer division.
    let shift = (month - 14) / 12;
    let julian = 1461 * (year + 4800 + shift) / 4 + 367 * (month - 2 - 12 * shift) / 12
        - 3 * ((year + 4900 + shift) / 100) / 4
        + day
        - 32075;
    let days = julian as f64 - 0.5 + hour / 24.0 - 2_451_545.0;
    let omega = 2.1429 - 0.001_039_459_4 * days;
    let mean_longitude = 4.895_063_0 + 0.017_202_791_698 * days;
    let anomaly = 6.240_060_0 + 0.017_201_969_9 * days;
    let longitude = mean_longitude + 0.033_416_07 * libm::sin(anomaly) + 0.000_348_94 * libm::sin(2.0 * anomaly)
        - 0.000_113_4
        - 0.000_020_3 * libm::sin(omega);
    let obliquity = 0.409_092_8 - 6.2140e-9 * days + 0.000_039_6 * libm::cos(omega);
    let ascension = libm::atan2(libm::cos(obliquity) * libm::sin(longitude), libm::cos(longitude));
    let sine = libm::sin(obliquity) * libm::sin(longitude);
    let cosine = (1.0 - sine * sine).max(0.0).sqrt();
    let greenwich = 6.697_424_324_2 + 0.065_709_828_3 * days + hour;
    let hour_angle = (greenwich * 15.0 + moment.longitude).to_radians() - ascension;
    let [cos_latitude, sin_latitude] = [libm::cos, libm::sin].map(|f| f(moment.latitude.to_radians()));
    let [cos_hour, sin_hour] = [libm::cos, libm::sin].map(|f| f(hour_angle));
    [
        -cosine * sin_hour,
        sine * cos_latitude - cosine * cos_hour * sin_latitude,
        cosine * cos_hour * cos_latitude + sine * sin_latitude,
    ]
}

/// Irradiance at normal incidence, W/m^2 in Mitsuba's units, by turbidity from 1 to 10 and elevation in degrees.
pub fn irradiance(turbidity: f64, elevation: f64) -> [f64; 3] {
    let turbidity = (turbidity - 1.0).clamp(0.0, 9.0);
    let clear = (turbidity as usize).min(8);
    let after = ELEVATIONS
        .iter()
        .position(|e| *e > elevation)
        .unwrap_or(ELEVATIONS.len() - 1);
    let (i, j) = (after.saturating_sub(1), after.max(1));
    let i = i.min(j - 1);
    let along = ((elevation - ELEVATIONS[i]) / (ELEVATIONS[j] - ELEVATIONS[i])).clamp(0.0, 1.0);
    let between = turbidity - clear as f64;
    std::array::from_fn(|c| {
        let at = |t: usize| IRRADIANCE[t][i][c] + along * (IRRADIANCE[t][j][c] - IRRADIANCE[t][i][c]);
        at(clear) + between * (at(clear + 1) - at(clear))
    })
}

/// Computed with Mitsuba 3.9.1: the integral of `sunsky` without its sky, negative values set to zero. It is linear
/// between entries, like its source data (Hosek and Wilkie, "Adding a solar-radiance function to the Hosek-Wilkie
/// skylight model", 2013).
#[rustfmt::skip]
const IRRADIANCE: [[[f64; 3]; 15]; 10] = [
    [
        [0.4838, 0.1379, 0.0], [0.8474, 0.3875, 0.05165], [1.061, 0.6005, 0.1668], [1.191, 0.7566, 0.2902],
        [1.275, 0.8705, 0.402], [1.334, 0.9551, 0.4978], [1.376, 1.02, 0.5784], [1.409, 1.071, 0.6465],
        [1.455, 1.145, 0.7528], [1.485, 1.196, 0.8305], [1.506, 1.232, 0.8888], [1.528, 1.269, 0.9509],
        [1.545, 1.3, 1.003], [1.554, 1.316, 1.032], [1.558, 1.323, 1.045],
    ],
    [
        [0.3837, 0.1071, 0.0], [0.7631, 0.3457, 0.04635], [0.9926, 0.5581, 0.1556], [1.134, 0.7171, 0.2758],
        [1.227, 0.8342, 0.3861], [1.292, 0.9222, 0.4814], [1.339, 0.9899, 0.5621], [1.376, 1.043, 0.6305],
        [1.427, 1.121, 0.7377], [1.461, 1.175, 0.8165], [1.485, 1.213, 0.8755], [1.509, 1.252, 0.939],
        [1.529, 1.285, 0.9922], [1.539, 1.302, 1.022], [1.544, 1.31, 1.035],
    ],
    [
        [0.2618, 0.07071, 0.0], [0.6417, 0.2862, 0.03865], [0.8891, 0.4946, 0.1387], [1.046, 0.6564, 0.2536],
        [1.151, 0.7779, 0.3611], [1.225, 0.8702, 0.4555], [1.28, 0.9421, 0.5363], [1.323, 0.9989, 0.6049],
        [1.382, 1.083, 0.7134], [1.423, 1.14, 0.7939], [1.451, 1.182, 0.8542], [1.479, 1.225, 0.9193],
        [1.502, 1.26, 0.9742], [1.515, 1.279, 1.005], [1.52, 1.288, 1.019],
    ],
    [
        [0.1395, 0.03561, 0.0], [0.4826, 0.2096, 0.02873], [0.7413, 0.4057, 0.1148], [0.9154, 0.5672, 0.2206],
        [1.036, 0.6932, 0.3237], [1.123, 0.791, 0.416], [1.189, 0.8681, 0.4961], [1.239, 0.9299, 0.5652],
        [1.312, 1.022, 0.6753], [1.361, 1.086, 0.7578], [1.396, 1.133, 0.8203], [1.431, 1.181, 0.8879],
        [1.46, 1.221, 0.9453], [1.475, 1.242, 0.9776], [1.482, 1.252, 0.9917],
    ],
    [
        [0.06947, 0.01662, 0.0], [0.354, 0.1496, 0.02083], [0.609, 0.3271, 0.09336], [0.7929, 0.4846, 0.19],
        [0.9247, 0.6119, 0.2874], [1.023, 0.7133, 0.3769], [1.097, 0.7947, 0.4561], [1.155, 0.8606, 0.525],
        [1.24, 0.96, 0.6365], [1.297, 1.03, 0.7207], [1.338, 1.081, 0.7851], [1.381, 1.135, 0.8551],
        [1.415, 1.179, 0.915], [1.434, 1.204, 0.9487], [1.442, 1.215, 0.9636],
    ],
    [
        [0.04002, 0.00912, 0.0], [0.2818, 0.1167, 0.01644], [0.5282, 0.28, 0.08057], [0.7147, 0.4325, 0.1703],
        [0.8522, 0.5594, 0.2639], [0.9556, 0.6622, 0.3511], [1.035, 0.7457, 0.4294], [1.098, 0.8141, 0.4979],
        [1.19, 0.9179, 0.61], [1.254, 0.9918, 0.6952], [1.299, 1.046, 0.7607], [1.346, 1.103, 0.8325],
        [1.384, 1.151, 0.8939], [1.405, 1.177, 0.9284], [1.414, 1.189, 0.9438],
    ],
    [
        [0.01615, 0.003385, 0.0], [0.1938, 0.07748, 0.01112], [0.4174, 0.2164, 0.06306], [0.6021, 0.3585, 0.1423],
        [0.7448, 0.4823, 0.2292], [0.8549, 0.5858, 0.3127], [0.9414, 0.6713, 0.3885], [1.01, 0.7426, 0.4563],
        [1.113, 0.8525, 0.5685], [1.184, 0.9315, 0.6551], [1.236, 0.9904, 0.7224], [1.29, 1.053, 0.7963],
        [1.334, 1.105, 0.8602], [1.358, 1.134, 0.8961], [1.369, 1.146, 0.9123],
    ],
    [
        [0.003658, 0.000667, 0.0], [0.1044, 0.03945, 0.005826], [0.2833, 0.1417, 0.04209], [0.4539, 0.263, 0.1061],
        [0.5961, 0.3777, 0.1816], [0.7109, 0.4785, 0.2578], [0.8046, 0.5646, 0.3296], [0.8807, 0.6382, 0.3952],
        [0.9965, 0.7543, 0.5062], [1.079, 0.8404, 0.594], [1.139, 0.905, 0.6629], [1.203, 0.9745, 0.7398],
        [1.256, 1.033, 0.807], [1.285, 1.066, 0.8453], [1.298, 1.081, 0.8624],
    ],
    [
        [0.000324, 0.000047, 0.0], [0.0376, 0.01294, 0.002019], [0.1493, 0.07034, 0.02158], [0.2845, 0.1578, 0.06513],
        [0.4127, 0.2523, 0.1236], [0.5248, 0.3428, 0.1878], [0.6205, 0.4245, 0.2513], [0.7019, 0.4972, 0.3115],
        [0.8299, 0.6166, 0.4181], [0.9244, 0.7087, 0.5054], [0.9956, 0.7797, 0.5754], [1.072, 0.8577, 0.6554],
        [1.136, 0.9248, 0.7266], [1.172, 0.9628, 0.7675], [1.188, 0.9798, 0.7861],
    ],
    [
        [0.000006, 0.0, 0.0], [0.00698, 0.002059, 0.000354], [0.05189, 0.02216, 0.007183], [0.1317, 0.06781, 0.02918],
        [0.225, 0.1297, 0.06567], [0.3178, 0.1975, 0.1112], [0.4044, 0.265, 0.1606], [0.4826, 0.329, 0.2105],
        [0.6137, 0.4422, 0.305], [0.7165, 0.5349, 0.387], [0.7965, 0.6097, 0.4558], [0.8856, 0.6949, 0.5369],
        [0.9631, 0.7704, 0.6108], [1.007, 0.8139, 0.6546], [1.026, 0.8337, 0.6746],
    ],
];

/// Elevations of the entries, degrees.
const ELEVATIONS: [f64; 15] = [
    2.0, 5.0, 8.0, 11.0, 14.0, 17.0, 20.0, 23.0, 29.0, 35.0, 41.0, 50.0, 62.0, 74.0, 90.0,
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from Mitsuba 3.9.1, which uses single precision: its day is off by up to an eighth, its sun by up to an
    /// eighth of a degree. The directions here are means of random samples.
    #[test]
    fn the_sun_stands_where_mitsubas_does() {
        let tokyo = |hour: f64| Moment {
            latitude: 35.6894,
            longitude: 139.6917,
            year: 2010,
            month: 7,
            day: 10,
            hour: hour - 9.0,
        };
        let elsewhere = Moment {
            latitude: 50.0,
            longitude: 10.0,
            year: 2020,
            month: 5,
            day: 2,
            hour: 7.0,
        };
        for (moment, expected) in [
            (tokyo(15.0), [0.04904777, 0.68070791, 0.73091111]),
            (tokyo(9.0), [0.08074974, -0.62976172, 0.77257987]),
            (tokyo(12.0), [0.2271617, 0.08123471, 0.97046303]),
            (elsewhere, [0.1362367, -0.85630459, 0.4981787]),
        ] {
            let [east, north, up] = position(&moment);
            let found = [-north, -east, up];
            let cosine: f64 = found.iter().zip(expected).map(|(a, b)| a * b).sum();
            assert!(cosine > libm::cos(f64::to_radians(2.0)), "{found:?}, {expected:?}");
        }
    }

    /// Values from Mitsuba 3.9.1, between entries too.
    #[test]
    fn the_sun_is_as_bright_as_mitsubas() {
        for (turbidity, elevation, expected) in [
            (3.0, 40.0, [1.44629214, 1.17554071, 0.84483305]),
            (3.0, 10.0, [0.99352057, 0.60246085, 0.21531161]),
            (5.0, 60.0, [1.41079661, 1.17353383, 0.90690577]),
            (10.0, 20.0, [0.40440916, 0.26498205, 0.16056956]),
            (1.0, 90.0, [1.55827391, 1.32312693, 1.04532678]),
        ] {
            let found = irradiance(turbidity, elevation);
            for c in 0..3 {
                assert!(
                    (found[c] / expected[c] - 1.0).abs() < 5e-3,
                    "{turbidity} {elevation}: {found:?}"
                );
            }
        }
    }
}
