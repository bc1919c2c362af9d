//! Inputs of photon paths besides the scene: parameters of the plan and the pass.

use crate::device::{Buffer, Device};
use crate::error::Result;
use crate::sampler::Stream;
use crate::world::rules::FlatRules;
use crate::world::waves::{Etas, Waves};
use beamfarm_image::radius::Schedule;
use beamfarm_render::cpu::beam::trace::kernel_paths;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::aov::LayerPlan;
use beamfarm_render::plan::estimators::PathEnds;
use beamfarm_render::plan::weights::Weights;
use beamfarm_render::sampler::Purpose;
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::medium::Medium;
use bytemuck::{Pod, Zeroable};

/// Widest kernel of a surface photon, relative to the size of the object it lands on.
const LOCAL: f32 = 0.25;

/// Parameters shared by all paths of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TracePlan {
    /// Random numbers; the chunk is the path.
    pub stream: Stream,
    /// Centre of the scene.
    pub center: [f32; 3],
    /// Its radius, scene units.
    pub bounds: f32,
    /// Planes with camera segments in front of them, normal and offset.
    pub view: [[f32; 4]; 5],
    /// Number of paths.
    pub paths: u32,
    /// The first ones, which store beams.
    pub beam_paths: u32,
    /// 1: they start evenly.
    pub is_even: u32,
    /// 1: out-of-view beams are not stored in media whose light beams contribute.
    pub has_view: u32,
    /// 1: after a photon has left surfaces and media that paths do not follow, its results may still count.
    pub goes_on: u32,
    /// 1: camera paths may end at a surface's photons; 2: all do at their second.
    pub ends_paths: u32,
    /// 1: some objects are pure boundaries of media.
    pub has_boundaries: u32,
    /// 1: beams are stored; 2: surface photons are.
    pub keeps: u32,
    /// Number of lights to choose from.
    pub lights: u32,
    /// Number of paths that kernel radii assume.
    pub kernel_paths: f32,
    /// Factor on the footprints of surface photons.
    pub surface_footprint: f32,
    /// Factor on the radii of beams.
    pub radius_scale: f32,
    /// Factor on the radii of surface photons.
    pub surface_scale: f32,
    /// Smallest base radius, scene units.
    pub floor: f32,
    /// Largest one for unscattered light.
    pub ceiling: f32,
    /// Largest one for other light.
    pub smooth_ceiling: f32,
    /// See [`Weights`].
    pub in_kernel: f32,
    /// See [`Weights`].
    pub least_flight: f32,
    /// Wavelengths of the pass.
    pub waves: u32,
    /// See [`Waves`].
    pub etas: Etas,
    padding: u32,
}

/// A light from which photons start.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TracedLight {
    /// Probability of this light and those before it.
    pub sum: f32,
    /// See [`Weights`].
    pub in_caustic: f32,
    /// 1: photons contribute the light that arrives via its specular surfaces; 2: no path meets it.
    pub bits: u32,
    /// Its own class bit.
    pub class_bit: u32,
    /// What its photons do not see, as class bits.
    pub hides: u32,
    /// The group whose layer it belongs to, from 1 on; 0: none.
    pub light_group: u32,
}

/// The group whose layer a light belongs to, from 1 on; 0: none.
pub(crate) fn number_of_group(layers: &LayerPlan, light: usize) -> u32 {
    layers.group(light).map_or(0, |group| group.index() as u32 + 1)
}

/// A medium on a photon's path.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TracedMedium {
    /// Distance beyond which a beam is invisible; scene units.
    pub reach: f32,
    /// The smallest extinction of the channels that scatter.
    pub least_sigma_t: f32,
    /// The widest base radius of a beam whose light has only met specular surfaces; scene units.
    pub widest_sharp: f32,
    /// The same for scattered light.
    pub widest_smooth: f32,
    /// 1: it scatters; 2: beams contribute all its light.
    pub flags: u32,
    /// What photons that it scatters do not see, as class bits, and the lights whose photons are not stored in it.
    pub hides: u32,
}

/// An object on a photon's path.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TracedObject {
    /// The widest kernel on it, before the pass's scale; scene units.
    pub widest: f32,
    /// 1: it scatters light that paths do not follow, and so needs photons; 2: it has a rough lobe that they follow; 4:
    /// rules leave the light that it scatters to photons.
    pub bits: u32,
    /// What photons that it scatters do not see, as class bits, and the lights whose photons do not light it.
    pub hides: u32,
}

/// All tables of a pass.
#[derive(Clone, Debug)]
pub struct TraceTables {
    /// Parameters.
    pub plan: TracePlan,
    /// By light.
    pub lights: Vec<TracedLight>,
    /// By medium.
    pub media: Vec<TracedMedium>,
    /// By object.
    pub objects: Vec<TracedObject>,
}

impl TraceTables {
    /// The tables of a pass.
    #[must_use]
    pub fn new(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self {
        let description = scene.description();
        let weights = Weights::new(scene, plan, pass_index);
        let waves = Waves::new(scene, plan, pass_index);
        let schedule = Schedule::new(&plan.settings);
        let (paths, beam_paths) = (plan.surface_paths, plan.settings.paths_per_pass);
        let rules = FlatRules::new(scene);
        let has = |object: &Object, flag: BsdfFlags| description.materials[object.material as usize].has(flag);
        let is = |bit: u32, is: bool| u32::from(is) * bit;
        let object = |(number, (object, extent)): (u32, (&Object, &f32))| TracedObject {
            widest: LOCAL * extent,
            bits: is(1, has(object, BsdfFlags::WIDE))
                | is(2, has(object, BsdfFlags::FOLLOWED | BsdfFlags::NARROW_LOBE))
                | is(4, !rules.of_object(number).is_gathered),
            hides: rules.of_object(number).photon,
        };
        let view = plan.view.as_ref().map(|view| view.planes());
        let sums = plan.emitters().sums();
        let lights = (sums.iter().zip(&weights.in_caustic).enumerate()).map(|(i, (sum, in_caustic))| TracedLight {
            sum: *sum,
            in_caustic: *in_caustic,
            bits: is(1, plan.estimators.brings_photons(i)) | is(2, description.lights[i].kind.is_unmet()),
            class_bit: rules.of_light(i).class,
            hides: rules.of_light(i).photon,
            light_group: number_of_group(&plan.layers, i),
        });
        let medium = |(id, medium): (u16, &Medium)| {
            let (reach, least_sigma_t) = match medium {
                Medium::Homogeneous(medium) => (medium.reach(), medium.least_sigma_t()),
                Medium::Heterogeneous(_) => (0.0, 0.0),
            };
            let widest = plan.widest_beams[usize::from(id)];
            TracedMedium {
                reach,
                least_sigma_t,
                widest_sharp: widest.sharp,
                widest_smooth: widest.smooth,
                flags: is(1, medium.scatters()) | is(2, plan.estimators.is_by_beams(id)),
                hides: rules.of_medium(id),
            }
        };
        Self {
            lights: lights.collect(),
            media: (0..).zip(&description.media).map(medium).collect(),
            objects: (0..)
                .zip(description.objects.iter().zip(scene.extents()))
                .map(object)
                .collect(),
            plan: TracePlan {
                stream: Stream::new(plan.settings.seed, pass_index, Purpose::Photons),
                center: description.bounds.center.to_array(),
                bounds: description.bounds.radius,
                view: view.map_or([[0.0; 4]; 5], |planes| {
                    planes.map(|(normal, offset)| normal.extend(offset).to_array())
                }),
                paths,
                beam_paths,
                is_even: plan.is_even.into(),
                has_view: plan.view.is_some().into(),
                goes_on: plan.estimators.photons_go_on().into(),
                ends_paths: match plan.estimators.ends() {
                    PathEnds::Never => 0,
                    PathEnds::FarEnough | PathEnds::First => 1,
                    PathEnds::Second => 2,
                },
                has_boundaries: description.objects.iter().any(|o| has(o, BsdfFlags::NULL)).into(),
                keeps: u32::from(plan.beams) | u32::from(plan.surface_photons) << 1,
                lights: sums.len() as u32,
                kernel_paths: kernel_paths(&plan.settings),
                surface_footprint: (beam_paths as f32 / paths as f32).sqrt(),
                radius_scale: schedule.scale(pass_index) as f32,
                surface_scale: schedule.surface_scale(pass_index) as f32,
                floor: plan.radii.floor,
                ceiling: plan.radii.ceiling,
                smooth_ceiling: plan.radii.smooth_ceiling,
                in_kernel: weights.in_kernel,
                least_flight: weights.least_flight,
                waves: waves.count,
                etas: waves.etas,
                padding: 0,
            },
        }
    }

    /// Uploads them to a device.
    ///
    /// # Errors
    /// Device errors.
    pub fn upload(&self, device: &Device) -> Result<TraceBuffers> {
        TraceBuffers::new(device, std::slice::from_ref(self))
    }
}

/// The tables on a device: bindings 45 to 48, in this order.
#[derive(Debug)]
pub struct TraceBuffers {
    /// One [`TracePlan`].
    pub plan: Buffer,
    /// [`TracedLight`]s.
    pub lights: Buffer,
    /// [`TracedMedium`]s.
    pub media: Buffer,
    /// [`TracedObject`]s.
    pub objects: Buffer,
}

impl TraceBuffers {
    /// Those of passes that are rendered together, of one scene and plan.
    ///
    /// # Errors
    /// Device errors.
    pub fn new(device: &Device, passes: &[TraceTables]) -> Result<Self> {
        let count = passes.len() as u32;
        let plans: Vec<_> = passes.iter().map(|pass| pass.plan).collect();
        let lights: Vec<_> = passes.iter().flat_map(|pass| &pass.lights).copied().collect();
        // They are the same in all passes.
        let (media, objects) = passes
            .first()
            .map_or((&[][..], &[][..]), |first| (&first.media[..], &first.objects[..]));
        Ok(Self {
            plan: device.parts("plan of photon paths", &plans, count)?,
            lights: device.parts("lights of photon paths", &lights, count)?,
            media: device.buffer("media of photon paths", media)?,
            objects: device.buffer("objects of photon paths", objects)?,
        })
    }
}
