//! Light that fills next to nothing of a medium: the beam of a laser, or of a spot with a tiny cone.

use crate::world::Scene;
use crate::world::light::{LightKind, Spot};

/// Half angle of a cone that counts as thin, radians. A path that scatters somewhere within reach of its apex is inside
/// with a probability of about the square of this.
const CONE: f32 = 0.02;

/// Whether a scattering medium may have such light in it. Camera paths that scatter in the medium hardly ever do so
/// inside the beam. When they do they are very bright, and small pictures cannot tell that light from none.
pub(super) fn has_thin_light(scene: &Scene) -> bool {
    scene.media().iter().any(|medium| medium.scatters()) && scene.lights().iter().any(|light| is_thin(&light.kind))
}

fn is_thin(kind: &LightKind) -> bool {
    match kind {
        LightKind::Laser(_) => true,
        LightKind::Spot(Spot { cutoff, radius, .. }) => *radius == 0.0 && *cutoff < CONE,
        _ => false,
    }
}
