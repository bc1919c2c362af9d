//! Lamps from photometric files.

use super::{Parts, Problem, asset_problem};
use crate::assets::ies::{self, Photometry};
use crate::parse::{Fault, LightRecord, LightType};
use crate::values::Spanned;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::light::{AngularTable, Goniometric, LightKind, Ramp};
use glam::DVec3;
use std::sync::Arc;

impl Parts<'_> {
    /// A lamp from a photometric file, of a spot limited to its cone: the ramp, and the half angles of the plateau and
    /// the cutoff.
    pub(super) fn by_table(
        &mut self,
        record: &LightRecord,
        file: &Spanned<String>,
        position: glam::Vec3,
        axis: DVec3,
        cone: Option<(Ramp, f64, f64)>,
    ) -> Result<Option<LightKind>, Problem> {
        if let Some(intensity) = &record.intensity {
            let message = "the intensity of a lamp by `ies` is that of the file; expected `scale` or `power`";
            return Err(Fault::new(intensity.span(), message).into());
        }
        if let (Some(scale), Some(_)) = (&record.scale, &record.power) {
            return Err(Fault::new(scale.span(), "expected `scale` or `power`, not both").into());
        }
        let photometry = super::decoded(self.assets.source, file, |_, bytes| ies::read(bytes))?;
        let cut;
        let lit = match cone {
            None => &*photometry,
            Some(cone) => {
                cut = within(&photometry, cone);
                &cut
            }
        };
        let Some(table) = AngularTable::new(&lit.vertical, &lit.horizontal, &lit.candela) else {
            // It emits nothing, or nothing within the cone.
            return Ok(None);
        };
        let scale = match &record.power {
            Some(power) => power.get_ref().0.map(|watts| watts / table.integral()),
            None => {
                let scale = record.scale.as_ref().map_or(Rgb::ONE, |scale| scale.get_ref().rgb());
                scale.to_array().map(|factor| f64::from(factor) / CANDELA_PER_INTENSITY)
            }
        };
        let scale = Rgb::from_array(scale.map(|x| x as f32));
        if !(scale * table.integral() as f32).is_finite() {
            return Err(asset_problem(file, "the lamp is too bright for single precision"));
        }
        let (up, place) = match &record.up {
            Some(up) => (up.get_ref().0, up.span()),
            None if axis.cross(DVec3::Z).length() < 1e-3 => (DVec3::Y, record.kind.span()),
            None => (DVec3::Z, record.kind.span()),
        };
        let zero = (up - axis * up.dot(axis)).normalize_or_zero();
        if zero == DVec3::ZERO || axis.cross(up.normalize_or_zero()).length() < 1e-9 {
            let message = "expected an `up` that does not run along the lamp's axis";
            return Err(Fault::new(place, message).into());
        }
        Ok((scale != Rgb::ZERO).then(|| {
            LightKind::Goniometric(Goniometric {
                position,
                axes: [zero, axis.cross(zero), axis].map(|axis| axis.as_vec3()),
                scale,
                table: Arc::new(table),
            })
        }))
    }
}

/// Lumens per watt, as for lights of glTF files.
const CANDELA_PER_INTENSITY: f64 = 683.0;

/// Samples of a spot's ramp in the table; between them the error is below 1e-4.
const RAMP_STEPS: u32 = 64;

/// A lamp's table limited to a spot's cone.
fn within(lamp: &Photometry, (ramp, plateau, cutoff): (Ramp, f64, f64)) -> Photometry {
    let of_ramp = (0..=RAMP_STEPS).map(|i| plateau + (cutoff - plateau) * f64::from(i) / f64::from(RAMP_STEPS));
    let most = lamp.vertical.last().copied().unwrap_or(0.0).min(cutoff);
    let least = lamp.vertical.first().copied().unwrap_or(0.0);
    let both = lamp.vertical.iter().copied().chain(of_ramp);
    let mut vertical: Vec<f64> = both.filter(|angle| (least..=most).contains(angle)).collect();
    vertical.sort_by(f64::total_cmp);
    vertical.dedup_by(|a, b| *a as f32 == *b as f32);
    let columns = lamp.horizontal.len();
    let row = |angle: f64| {
        let after = lamp.vertical.partition_point(|edge| *edge <= angle);
        let after = after.clamp(1, lamp.vertical.len() - 1);
        let [a, b] = [lamp.vertical[after - 1], lamp.vertical[after]];
        let share = (angle - a) / (b - a);
        let [x, y] = [after - 1, after].map(|row| &lamp.candela[row * columns..][..columns]);
        let falloff = spot_falloff(ramp, plateau, cutoff, angle);
        x.iter()
            .zip(y)
            .map(move |(x, y)| (x + (y - x) * share).max(0.0) * falloff)
    };
    Photometry {
        candela: vertical.iter().flat_map(|angle| row(*angle)).collect(),
        horizontal: lamp.horizontal.clone(),
        vertical,
    }
}

/// A spot's falloff at an angle to its axis, in [0, cutoff].
pub(super) fn spot_falloff(ramp: Ramp, plateau: f64, cutoff: f64, angle: f64) -> f64 {
    match ramp {
        Ramp::Linear => ((cutoff - angle) / (cutoff - plateau)).clamp(0.0, 1.0),
        Ramp::Smooth => {
            let [a, b, c] = [plateau, angle, cutoff].map(libm::cos);
            let x = ((b - c) / (a - c)).clamp(0.0, 1.0);
            x * x * (3.0 - 2.0 * x)
        }
    }
}

/// Refuse fields that only lamps with `ies` have.
pub(super) fn of_tables_alone(record: &LightRecord) -> Result<(), Fault> {
    let is_point = *record.kind.get_ref() == LightType::Point;
    let given = [
        ("scale", record.scale.as_ref().map(|f| f.span())),
        ("up", record.up.as_ref().map(|f| f.span())),
        ("target", record.target.as_ref().map(|f| f.span()).filter(|_| is_point)),
        ("direction", record.direction.as_ref().map(|f| f.span())),
    ];
    let place = given.into_iter().find_map(|(name, place)| Some((name, place?)));
    match place {
        Some(("up", _)) if !is_point => Ok(()),
        Some((name, place)) => Err(Fault::new(place, format!("`{name}` is for lamps with `ies`"))),
        None => Ok(()),
    }
}
