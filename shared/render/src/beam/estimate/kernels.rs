//! The code that adds beams to a block of segments, for each kind of medium and segments and each kind of vectors.

use super::super::store::PieceList;
use super::block::{Block, Shared};
use super::kind::{Colour, Coloured, Grey, Kind};
use super::kind::{Even, EvenFromPinhole, Uneven};
use super::kind::{Isotropic, OneLobe, Turning, TwoLobes};
use super::line::BeamLine;
use super::vectors::{Found, Work};
use crate::medium::Medium;
use crate::phase::Phase;
use std::marker::PhantomData;

/// The code for one kind.
#[derive(Clone, Copy)]
pub(super) struct Kernels {
    /// Adds lines at these positions to a block.
    pub lines: fn(Found, &mut Block, &Shared, &[BeamLine], &[u32]),
    /// Adds pieces at these positions to a block of one segment.
    pub pieces: fn(Found, &mut Block, &Shared, &PieceList, &[u32]),
}

impl Kernels {
    /// For a medium. `pinhole`: for segments that share their origin.
    pub fn of(medium: &Medium, pinhole: bool) -> Self {
        let sigma_t = medium.sigma_t();
        let tinted = matches!(medium, Medium::Heterogeneous(medium) if medium.albedo().is_some());
        match !tinted && sigma_t.x == sigma_t.y && sigma_t.y == sigma_t.z {
            true => Self::of_colour::<Grey>(medium, pinhole),
            false => Self::of_colour::<Coloured>(medium, pinhole),
        }
    }

    fn of_colour<C: Colour>(medium: &Medium, pinhole: bool) -> Self {
        match medium.phase() {
            Phase::Isotropic => Self::of_turning::<C, Isotropic>(medium, pinhole),
            Phase::HenyeyGreenstein { .. } => Self::of_turning::<C, OneLobe>(medium, pinhole),
            Phase::Blend { .. } => Self::of_turning::<C, TwoLobes>(medium, pinhole),
        }
    }

    fn of_turning<C: Colour, T: Turning>(medium: &Medium, pinhole: bool) -> Self {
        match (medium, pinhole) {
            (Medium::Heterogeneous(_), _) => Self::new::<(C, T, Uneven)>(),
            (Medium::Homogeneous(_), true) => Self::new::<(C, T, EvenFromPinhole)>(),
            (Medium::Homogeneous(_), false) => Self::new::<(C, T, Even)>(),
        }
    }

    fn new<K: Kind>() -> Self {
        Self {
            lines: add_lines::<K>,
            pieces: add_pieces::<K::OneByOne>,
        }
    }
}

fn add_lines<K: Kind>(vectors: Found, block: &mut Block, shared: &Shared, lines: &[BeamLine], near: &[u32]) {
    struct Lines<'a, 'b, 'c, K>(
        &'a mut Block<'b>,
        &'a Shared<'c>,
        &'a [BeamLine],
        &'a [u32],
        PhantomData<K>,
    );
    impl<K: Kind> Work for Lines<'_, '_, '_, K> {
        #[inline(always)]
        fn run(self) {
            let Self(block, shared, lines, near, _) = self;
            block.add_lines::<K>(shared, lines, near);
        }
    }
    vectors.run(Lines::<K>(block, shared, lines, near, PhantomData));
}

fn add_pieces<K: Kind>(vectors: Found, block: &mut Block, shared: &Shared, list: &PieceList, near: &[u32]) {
    struct Pieces<'a, 'b, 'c, K>(
        &'a mut Block<'b>,
        &'a Shared<'c>,
        &'a PieceList,
        &'a [u32],
        PhantomData<K>,
    );
    impl<K: Kind> Work for Pieces<'_, '_, '_, K> {
        #[inline(always)]
        fn run(self) {
            let Self(block, shared, list, near, _) = self;
            block.add_pieces::<K>(shared, list, near);
        }
    }
    vectors.run(Pieces::<K>(block, shared, list, near, PhantomData));
}
