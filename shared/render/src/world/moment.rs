//! The moment at which a pass sees a moving scene.

use super::{Motion, Scene};
use crate::sampler::{Purpose, Sampler};
use crate::world::bsdf::BsdfFlags;

impl Motion {
    /// When a pass sees the scene, in frames. Evenly spread over the passes of a replication.
    pub fn time(&self, seed: u64, pass_index: u64) -> f64 {
        let [open, close] = self.shutter();
        let u = Sampler::even(seed, pass_index, Purpose::Shutter, 0).next_1d();
        open + (close - open) * f64::from(u)
    }
}

impl Scene {
    /// The scene as a pass sees it, if that differs from this one.
    ///
    /// # Errors
    /// If the moving parts cannot be evaluated at that moment.
    pub fn moment(&self, seed: u64, pass_index: u64) -> Result<Option<Self>, String> {
        let Some(motion) = self.description.motion.as_ref().filter(|motion| motion.blurs()) else {
            return Ok(None);
        };
        let time = motion.time(seed, pass_index);
        let mut description = motion.at(time).map_err(|why| format!("at {time} frames: {why}"))?;
        let (here, now) = (&self.description.camera, &description.camera);
        if (here.width, here.height) != (now.width, now.height) {
            return Err(format!("at {time} frames the image has another size"));
        }
        description.interrupt = self.description.interrupt.clone();
        Ok(Some(Self::new_like(self, description)))
    }

    /// Whether one plan serves both scenes: they have the same objects of the same kinds, wherever they are.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let (one, other) = (&self.description, &other.description);
        let materials = one.materials.iter().zip(&other.materials);
        let objects = one.objects.iter().zip(&other.objects);
        let media = one.media.iter().zip(&other.media);
        let mut lights = one.lights.iter().zip(&other.lights);
        one.materials.len() == other.materials.len()
            && one.objects.len() == other.objects.len()
            && one.media.len() == other.media.len()
            && one.lights.len() == other.lights.len()
            && materials.into_iter().all(|(one, other)| {
                let differing = one.flags() ^ other.flags();
                !differing.intersects(BsdfFlags::NULL | BsdfFlags::SPECULAR | BsdfFlags::PASSABLE)
                    && one.turns_paths() == other.turns_paths()
            })
            && objects.into_iter().all(|(one, other)| {
                (one.material, one.light, one.boundary, one.priority)
                    == (other.material, other.light, other.boundary, other.priority)
            })
            && media.into_iter().all(|(one, other)| one.scatters() == other.scatters())
            && lights.all(|(one, other)| {
                one.group == other.group
                    && one.is_two_sided() == other.is_two_sided()
                    && std::mem::discriminant(&one.kind) == std::mem::discriminant(&other.kind)
            })
    }
}
