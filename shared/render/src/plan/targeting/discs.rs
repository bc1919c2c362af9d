//! Discs that photons are aimed at, and the density of aimed rays.

use super::Viewpoint;
use crate::math::{Frame, PI, Ray, Vec2, Vec3};
use crate::parallel;
use crate::warp;
use crate::wide::{Below, WideTree};
use crate::world::geometry::flat::{Child, Node};
use crate::world::light::{SceneBounds, cdf};
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};
use std::time::Duration;

/// Most discs of a light.
pub(super) const MOST: usize = 2048;
/// Number of nearest neighbours that a disc encloses.
const NEIGHBOURS: usize = 8;
/// Radii are limited to the mean plus this many standard deviations.
const MAX_DEVIATIONS: f32 = 3.0;
/// Smallest radius, relative to the scene's.
const MIN_RADIUS: f32 = 1e-5;
/// Most and least weight of a place, relative to the mean.
const MAX_WEIGHT: f32 = 10.0;
const MIN_WEIGHT: f32 = 0.1;
/// Cosines of the narrowest and widest cone of directions to the light: 5 and 85 degrees.
const NARROWEST: f32 = 0.996_194_7;
const WIDEST: f32 = 0.087_155_74;

/// Share of directions that are drawn from the whole hemisphere.
pub const WIDE: f32 = 0.3;

/// A disc that faces a light.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    /// Its middle.
    pub center: Vec3,
    /// Unit direction to the light.
    pub normal: Vec3,
    /// Radius, scene units.
    pub radius: f32,
    /// Cosine of the cone around `normal` from which directions to a distant light are drawn.
    pub cos_spread: f32,
    /// Probability of choosing the disc, over its area.
    pub density: f32,
}

impl Boundable for Disc {
    fn aabb(&self) -> Aabb {
        let across = (Vec3::ONE - self.normal * self.normal).max(Vec3::ZERO);
        let half = Vec3::new(across.x.sqrt(), across.y.sqrt(), across.z.sqrt()) * self.radius;
        crate::wide::padded(self.center - half, self.center + half)
    }
}

/// The discs of a light, in a tree for rays.
pub struct Discs {
    discs: Vec<Disc>,
    /// Running sums of the probabilities.
    sums: Vec<f32>,
    tree: WideTree,
}

impl std::fmt::Debug for Discs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Discs({})", self.discs.len())
    }
}

/// The largest weight that a place may have.
pub(super) fn heaviest(places: &[Viewpoint]) -> f32 {
    MAX_WEIGHT * places.iter().map(|p| p.weight).sum::<f32>() / places.len() as f32
}

impl Discs {
    /// Discs around the first places, each enclosing its 8 nearest neighbours. There may be more places than discs.
    pub(crate) fn new(places: &[Viewpoint], bounds: &SceneBounds) -> Self {
        let places = &places[..places.len().min(MOST)];
        let mut around = parallel::map(places.len(), |i| neighbourhood(places, &places[i]));
        let count = around.len() as f32;
        let mean = around.iter().map(|(r, _)| r).sum::<f32>() / count;
        let variance = around.iter().map(|(r, _)| (r - mean) * (r - mean)).sum::<f32>() / count;
        let most = mean + MAX_DEVIATIONS * variance.sqrt();
        for (radius, _) in &mut around {
            *radius = radius.min(most).max(MIN_RADIUS * bounds.radius);
        }
        let heaviest = heaviest(places);
        let least = MIN_WEIGHT / MAX_WEIGHT * heaviest;
        let weights: Vec<f64> = places
            .iter()
            .map(|place| f64::from(place.weight.min(heaviest) + least))
            .collect();
        let sums = cdf::running_sums(&weights);
        let disc = |(i, place): (usize, &Viewpoint)| {
            let (radius, cos) = around[i];
            Disc {
                center: place.point,
                normal: place.towards,
                radius,
                cos_spread: cos.clamp(WIDEST, NARROWEST),
                density: cdf::pmf(&sums, i) / (PI * radius * radius),
            }
        };
        let discs: Vec<Disc> = places.iter().enumerate().map(disc).collect();
        let params = BvhBuildParams {
            max_prims_per_leaf: 1,
            ..BvhBuildParams::medium_build()
        };
        let binary = build_bvh2(&discs, params, &mut Duration::default());
        let is_leaf: Vec<bool> = binary.nodes.iter().map(|node| node.is_leaf()).collect();
        let tree = WideTree::new(&binary, &is_leaf, |index| {
            binary.primitive_indices[binary.nodes[index].first_index as usize]
        });
        Self { discs, sums, tree }
    }

    /// Each disc, with the running sum of probabilities up to and including it.
    pub fn with_sums(&self) -> impl ExactSizeIterator<Item = (&Disc, f32)> {
        self.discs.iter().zip(self.sums.iter().copied())
    }

    /// The nodes of the tree over the discs, the root first. The discs are its objects.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = Node> {
        self.tree.nodes().iter().map(|node| {
            let child = |place: usize| match node.child(place) {
                None => Child::None,
                Some(Below::Node(number)) => Child::Node(number),
                Some(Below::Leaf(number)) => Child::Object(number),
            };
            Node {
                bounds: node.bounds.map(|sides| sides.map(|four| four.to_array())),
                children: [0, 1, 2, 3].map(child),
            }
        })
    }

    /// Entries that a traversal's stack may need in that tree.
    pub fn stack(&self) -> usize {
        self.tree.stack()
    }

    /// Number of discs.
    pub fn len(&self) -> usize {
        self.discs.len()
    }

    /// Whether there are no discs; there is always at least one.
    pub fn is_empty(&self) -> bool {
        self.discs.is_empty()
    }

    /// Calls `visit(disc, t, cos)` for every disc whose front the ray meets, anywhere along it: at distance `t`, with
    /// this cosine between the ray and the disc's normal.
    #[inline]
    pub fn along(&self, ray: &Ray, mut visit: impl FnMut(&Disc, f32, f32)) {
        self.met(ray, |disc, t, cos| {
            if cos > 0.0 {
                visit(disc, t, cos);
            }
        });
    }

    /// Number of discs along a ray up to a distance, seen from either side.
    pub(crate) fn count(&self, ray: &Ray, length: f32) -> u32 {
        let mut count = 0;
        self.met(ray, |disc, t, _| count += u32::from(t - disc.radius < length));
        count
    }

    /// Number of discs that are looked at along a ray: the cost of its density.
    pub(super) fn work(&self, ray: &Ray) -> u32 {
        let mut count = 0;
        self.tree.along_ray(ray.origin, ray.dir, f32::INFINITY, |_, t_max| {
            count += 1;
            t_max
        });
        count
    }

    /// As [`Self::along`], for both sides; at the back the cosine is negative.
    #[inline(always)]
    fn met(&self, ray: &Ray, mut visit: impl FnMut(&Disc, f32, f32)) {
        self.tree.along_ray(ray.origin, ray.dir, f32::INFINITY, |leaf, t_max| {
            let disc = &self.discs[leaf as usize];
            let (t, cos) = disc.crossing(ray);
            if cos != 0.0 && t > 0.0 {
                let off = ray.at(t) - disc.center;
                if off.length_squared() <= disc.radius * disc.radius {
                    visit(disc, t, cos);
                }
            }
            t_max
        });
    }

    /// A point on one of the discs. `choice`, `u`: uniform in [0, 1); what remains of `choice` is uniform again.
    pub(crate) fn point(&self, choice: &mut f32, u: Vec2) -> (Vec3, Drawn<'_>) {
        let chosen = cdf::choose(&self.sums, *choice);
        *choice = chosen.u;
        let disc = &self.discs[chosen.index];
        let on_disc = (warp::concentric_disk(u) * disc.radius).extend(0.0);
        let point = disc.center + Frame::from_normal(disc.normal).to_world(on_disc);
        let drawn = Drawn {
            disc,
            is_in_cone: false,
        };
        (point, drawn)
    }

    /// Density per solid angle of directions from the ray's origin to points on the fronts of discs. `drawn`: what the
    /// ray was drawn through, if it was.
    pub(crate) fn pdf_from(&self, ray: &Ray, drawn: Option<Drawn<'_>>) -> f32 {
        let mut pdf = 0.0;
        self.along_drawn(ray, drawn, |disc, t, cos| {
            pdf += disc.density * (t * t / cos);
        });
        pdf
    }

    /// Density of rays in this direction through points on the fronts of discs, per area across them; and that of rays
    /// whose directions come from [`Drawn::draw_direction`], per solid angle as well. `drawn`: as above.
    pub(crate) fn pdf_across(&self, ray: &Ray, drawn: Option<Drawn<'_>>) -> [f32; 2] {
        let (mut of_point, mut of_line) = (0.0, 0.0);
        self.along_drawn(ray, drawn, |disc, _, cos| {
            let density = disc.density / cos;
            of_point += density;
            let mut directions = WIDE / (2.0 * PI);
            let is_in_cone = drawn.is_some_and(|drawn| drawn.is_in_cone && drawn.is(disc));
            if is_in_cone || cos >= disc.cos_spread {
                directions += (1.0 - WIDE) * warp::uniform_cone_pdf(disc.cos_spread);
            }
            of_line += density * directions;
        });
        [of_point, of_line]
    }

    /// As [`Self::along`], but always including the disc that the ray was drawn through. Rounding may put the ray
    /// outside its rim. The photon would then stand for light that is seldom aimed there: too much, and the more so the
    /// smaller the discs.
    fn along_drawn(&self, ray: &Ray, drawn: Option<Drawn<'_>>, mut visit: impl FnMut(&Disc, f32, f32)) {
        self.along(ray, |disc, t, cos| {
            if !drawn.is_some_and(|drawn| drawn.is(disc)) {
                visit(disc, t, cos);
            }
        });
        if let Some(Drawn { disc, .. }) = drawn {
            let (t, cos) = disc.crossing(ray);
            if cos > 0.0 {
                visit(disc, t, cos);
            }
        }
    }
}

/// The disc that a ray was drawn through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn<'a> {
    pub(crate) disc: &'a Disc,
    /// Whether the direction was drawn in the disc's cone.
    is_in_cone: bool,
}

impl Drawn<'_> {
    fn is(&self, disc: &Disc) -> bool {
        std::ptr::eq(self.disc, disc)
    }

    /// Direction of travel of distant light: uniform in the cone of directions that the light came from around here or,
    /// some of the time, in the hemisphere that the disc faces.
    pub(crate) fn draw_direction(&mut self, u: Vec2) -> Vec3 {
        self.is_in_cone = u.x >= WIDE;
        let (x, cos) = match self.is_in_cone {
            false => (u.x / WIDE, 0.0),
            true => ((u.x - WIDE) / (1.0 - WIDE), self.disc.cos_spread),
        };
        let towards = warp::uniform_cone(Vec2::new(x, u.y), cos);
        -Frame::from_normal(self.disc.normal).to_world(towards)
    }
}

impl Disc {
    /// Where a ray meets the disc's plane, and the cosine of its angle there; positive in front.
    #[inline(always)]
    fn crossing(&self, ray: &Ray) -> (f32, f32) {
        let cos = -self.normal.dot(ray.dir);
        (self.normal.dot(ray.origin - self.center) / cos, cos)
    }
}

/// Distance of the 8th nearest place, and the least cosine between a place's direction to the light and those of the 8
/// nearest.
fn neighbourhood(places: &[Viewpoint], of: &Viewpoint) -> (f32, f32) {
    // Nearest first; the place itself comes first of all.
    let mut nearest = [(f32::INFINITY, 1.0); NEIGHBOURS + 1];
    for place in places {
        let distance2 = (place.point - of.point).length_squared();
        if distance2 < nearest[NEIGHBOURS].0 {
            let mut at = NEIGHBOURS;
            while at > 0 && nearest[at - 1].0 > distance2 {
                nearest[at] = nearest[at - 1];
                at -= 1;
            }
            nearest[at] = (distance2, place.towards.dot(of.towards));
        }
    }
    let least = nearest.iter().fold(1.0f32, |least, n| least.min(n.1));
    (nearest[NEIGHBOURS].0.sqrt(), least)
}
