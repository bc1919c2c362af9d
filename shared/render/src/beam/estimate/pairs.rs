//! The 1D estimate of pairs of beam and segment side by side: of one beam and several segments, or one segment and
//! several beams.

// Loops over lanes by number are what becomes vector code.
#![allow(clippy::needless_range_loop)]

use super::super::lanes::{LANES, Lanes};
use super::block::Shared;
use super::kind::Kind;
use super::meeting::Meeting;
use super::varying::Attenuation;
use crate::math::exp_neg;

/// The kernel along a piece of a beam.
#[derive(Clone, Copy)]
pub(super) struct Cone {
    /// Where the beam starts, and its change per unit of length.
    pub radius: f32,
    pub radius_slope: f32,
    /// The piece is from `start`, exclusive, to `end` from the beam's origin.
    pub start: f32,
    pub end: f32,
}

/// A beam and a segment.
pub(super) struct Pair {
    /// 1 where they contribute.
    pub hit: u32,
    /// Where the two are nearest. Zero, as the value is, where they do not contribute.
    pub along_segment: f32,
    pub along_beam: f32,
    /// Kernel over sine, times the phase function.
    pub value: f32,
}

impl Pair {
    /// `reached`: 1 where [`Meeting::is_reached`] says so. `length`: of the segment.
    #[inline(always)]
    pub fn new<K: Kind>(shared: &Shared, meeting: Meeting, reached: u32, cone: Cone, length: f32) -> Self {
        let at = meeting.nearest(cone.radius, cone.radius_slope);
        let hit = reached
            & (at.t > 0.0) as u32
            & (at.t < length) as u32
            & (at.s > cone.start) as u32
            & (at.s <= cone.end) as u32
            & (at.x < 1.0) as u32;
        let value = at.value * shared.phase::<K>(meeting.cos);
        Self {
            hit,
            along_segment: if hit != 0 { at.t } else { 0.0 },
            // Before its start, where its kernel reaches beyond the surface that it starts on, it is as strong as
            // there.
            along_beam: if hit != 0 { at.s.max(0.0) } else { 0.0 },
            value: if hit != 0 { value } else { 0.0 },
        }
    }
}

/// What pairs bring, one in each lane. Arrays by themselves, here and where they are made: in a record together they do
/// not stay in registers.
pub(super) struct Pairs<'a> {
    /// What all channels have in common.
    pub value: &'a Lanes,
    /// What comes to the camera by channel, where the medium varies, and density times length of what is in closed
    /// form.
    pub transmitted: &'a [Lanes; 3],
    pub depth: &'a Lanes,
}

/// The value of pairs in a medium that varies.
#[inline(always)]
pub(super) fn attenuated<K: Kind>(value: &Lanes, at: &Attenuation) -> Lanes {
    let mut out = [0.0; LANES];
    for l in 0..LANES {
        let v = value[l] * at.density[l];
        out[l] = if K::GREY { v * at.transmitted[0][l] } else { v };
    }
    out
}

impl Pairs<'_> {
    /// Calls `add(channel, lane, radiance)` for all that they bring. `power`: of a lane's beam in a channel, times
    /// sigma_s.
    #[inline(always)]
    pub fn add_to<K: Kind>(
        &self,
        shared: &Shared,
        power: impl Fn(usize, usize) -> f32,
        mut add: impl FnMut(usize, usize, f32),
    ) {
        let sigma_t = shared.sigma_t;
        if K::GREY {
            for l in 0..LANES {
                let value = self.value[l] * exp_neg(-sigma_t.x * self.depth[l]);
                add(0, l, value * power(0, l));
                add(1, l, value * power(1, l));
                add(2, l, value * power(2, l));
            }
        } else {
            self.add_channel::<K, 0>(sigma_t.x, &power, &mut add);
            self.add_channel::<K, 1>(sigma_t.y, &power, &mut add);
            self.add_channel::<K, 2>(sigma_t.z, &power, &mut add);
        }
    }

    #[inline(always)]
    fn add_channel<K: Kind, const C: usize>(
        &self,
        sigma_t: f32,
        power: &impl Fn(usize, usize) -> f32,
        add: &mut impl FnMut(usize, usize, f32),
    ) {
        for l in 0..LANES {
            let mut transmitted = exp_neg(-sigma_t * self.depth[l]);
            if K::VARYING {
                transmitted *= self.transmitted[C][l];
            }
            add(C, l, self.value[l] * transmitted * power(C, l));
        }
    }
}
