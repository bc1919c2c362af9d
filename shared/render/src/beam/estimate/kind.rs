//! Kinds of media and segments, each of which has code of its own.

/// What is known where code is compiled. [`crate::beam::estimate`] has code for the kinds that there are: triples of a
/// [`Colour`], a [`Turning`] and a [`Density`].
pub(super) trait Kind {
    /// Extinction, and the albedo where it varies, are the same for red, green and blue.
    const GREY: bool;
    /// How many lobes of the phase function are not isotropic.
    const LOBES: usize;
    /// The density varies from place to place.
    const VARYING: bool;
    /// All segments start where the camera is.
    const PINHOLE: bool;
    /// The same, for segments that are looked at one by one: these share nothing.
    type OneByOne: Kind;
}

/// Of extinction.
pub(super) trait Colour {
    const GREY: bool;
}

/// The same for red, green and blue.
pub(super) struct Grey;
/// Not the same.
pub(super) struct Coloured;

/// What the phase function is made of.
pub(super) trait Turning {
    const LOBES: usize;
}

/// The same in all directions.
pub(super) struct Isotropic;
/// One lobe of Henyey and Greenstein.
pub(super) struct OneLobe;
/// Two of them.
pub(super) struct TwoLobes;

/// Of the medium, and where segments start, which matters little beside a density that varies.
pub(super) trait Density {
    const VARYING: bool;
    const PINHOLE: bool;
    type OneByOne: Density;
}

/// A homogeneous medium, and segments that start anywhere.
pub(super) struct Even;
/// A homogeneous medium, and segments that start where the camera is.
pub(super) struct EvenFromPinhole;
/// A heterogeneous medium.
pub(super) struct Uneven;

impl Colour for Grey {
    const GREY: bool = true;
}

impl Colour for Coloured {
    const GREY: bool = false;
}

impl Turning for Isotropic {
    const LOBES: usize = 0;
}

impl Turning for OneLobe {
    const LOBES: usize = 1;
}

impl Turning for TwoLobes {
    const LOBES: usize = 2;
}

impl Density for Even {
    const VARYING: bool = false;
    const PINHOLE: bool = false;
    type OneByOne = Self;
}

impl Density for EvenFromPinhole {
    const VARYING: bool = false;
    const PINHOLE: bool = true;
    type OneByOne = Even;
}

impl Density for Uneven {
    const VARYING: bool = true;
    const PINHOLE: bool = false;
    type OneByOne = Self;
}

impl<C: Colour, T: Turning, D: Density> Kind for (C, T, D) {
    const GREY: bool = C::GREY;
    const LOBES: usize = T::LOBES;
    const VARYING: bool = D::VARYING;
    const PINHOLE: bool = D::PINHOLE;
    type OneByOne = (C, T, D::OneByOne);
}
